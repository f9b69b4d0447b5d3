//! imu_can
