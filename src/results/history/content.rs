//! What makes two files one recording: the same bytes, whatever their names.

/// Identity of a file's content: its size and its CRC-64 (ECMA-182 polynomial, as in xz). That two different recordings
/// of one size share it by chance has a probability of 5e-20; forging one gains nothing.
pub fn identity(bytes: &[u8]) -> String {
    const CRC: crc::Crc<u64, crc::Table<16>> = crc::Crc::<u64, crc::Table<16>>::new(&crc::CRC_64_XZ);
    format!("{}-{:016x}", bytes.len(), CRC.checksum(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_value_is_that_of_the_catalogue_of_crcs() {
        // https://reveng.sourceforge.io/crc-catalogue/all.htm: CRC-64/XZ, check = 0x995dc9bbdf1939fa of "123456789"
        assert_eq!(identity(b"123456789"), "9-995dc9bbdf1939fa");
        assert_ne!(identity(b"12345678"), identity(b"12345679"));
    }
}
