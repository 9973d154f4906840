//! Wire protocols, bytes to values and back, without any I/O.

pub mod frames;
pub mod lines;
pub mod modbus;
pub(crate) mod pieces;
pub mod registers;
