//! Files of named arrays, as MATLAB, Octave, SciPy and h5py write them: arrays and the times that belong to them become
//! tables.

pub(crate) mod contents;
pub(crate) mod hdf5;
pub(crate) mod mat;
pub(crate) mod table;
pub(crate) mod times;
