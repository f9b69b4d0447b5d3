//! imagenex881
