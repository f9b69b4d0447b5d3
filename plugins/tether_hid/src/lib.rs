//! tether_hid
