mod jacobians;
mod noise;
