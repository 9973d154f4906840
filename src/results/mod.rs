//! One fit on disk and many: fit files, model files, tables, the index of a folder.

pub mod fit_file;
pub mod fit_record;
pub mod history;
pub mod model_file;
pub mod parquet;
pub mod table;

#[cfg(test)]
mod old_files;
