//! The method of characteristics.
