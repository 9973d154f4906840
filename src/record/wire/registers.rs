//! Which Modbus registers are read together, and what their words mean.

use crate::rig::{Encoding, Register};

/// Most registers that one request may ask for.
const MOST_REGISTERS: u16 = 125;

/// One value of a device: where it lies and how it is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Address of its first register.
    pub address: u16,
    /// Its layout.
    pub register: Register,
}

impl Place {
    fn words(&self) -> u16 {
        self.register.encoding.words() as u16
    }
}

/// Values that are read in one request: they lie one behind the other, with nothing between them (a device may refuse
/// to read an address that it does not have).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// Input registers (function 4) rather than holding registers (function 3).
    pub input: bool,
    /// Address of the first register.
    pub start: u16,
    /// Number of registers.
    pub count: u16,
    /// Index of each value in the list that was grouped.
    pub members: Vec<usize>,
}

/// Puts values into as few requests as they can be read with.
pub fn group(places: &[Place]) -> Vec<Group> {
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by_key(|&i| (!places[i].register.input, places[i].address));
    let mut groups: Vec<Group> = Vec::new();
    for index in order {
        let place = places[index];
        let (input, start, words) = (place.register.input, place.address, place.words());
        match groups.last_mut() {
            Some(last)
                if last.input == input
                    && u32::from(last.start) + u32::from(last.count) == u32::from(start)
                    && last.count + words <= MOST_REGISTERS =>
            {
                last.count += words;
                last.members.push(index);
            }
            _ => groups.push(Group { input, start, count: words, members: vec![index] }),
        }
    }
    groups
}

/// Orders groups that are read in turn so that the answers of as few neighbours as possible have the same form
/// (function and length), for between two such an echo is needed (see [`crate::record::devices::poll`]).
pub fn alternate(groups: Vec<Group>) -> Vec<Group> {
    let form = |group: &Group| (group.input, group.count);
    let like = |group: &Group| groups.iter().filter(|other| form(other) == form(group)).count();
    let mut order: Vec<&Group> = groups.iter().collect();
    order.sort_by_key(|group| (std::cmp::Reverse(like(group)), form(group)));
    // The most frequent form takes every other place first.
    let places = (0..groups.len()).step_by(2).chain((1..groups.len()).step_by(2));
    let mut placed: Vec<(usize, &Group)> = places.zip(order).collect();
    placed.sort_by_key(|(place, _)| *place);
    placed.into_iter().map(|(_, group)| group.clone()).collect()
}

/// The number in `words`, the registers from `start` on; `None` where they do not reach it, or where it is no finite
/// number.
pub fn value(place: &Place, start: u16, words: &[u16]) -> Option<f64> {
    let at = usize::from(place.address.checked_sub(start)?);
    let first = *words.get(at)?;
    let double = || {
        let second = *words.get(at + 1)?;
        let (high, low) = if place.register.big_word_order { (first, second) } else { (second, first) };
        Some(u32::from(high) << 16 | u32::from(low))
    };
    let number = match place.register.encoding {
        Encoding::U16 => f64::from(first),
        Encoding::I16 => f64::from(first.cast_signed()),
        Encoding::U32 => f64::from(double()?),
        Encoding::I32 => f64::from(double()?.cast_signed()),
        Encoding::F32 => f64::from(f32::from_bits(double()?)),
    };
    number.is_finite().then_some(number)
}

/// The words that say `number`, the nearest that the encoding has; the inverse of [`value`].
pub fn words(register: &Register, number: f64) -> Vec<u16> {
    let double = |bits: u32| {
        let (high, low) = ((bits >> 16) as u16, bits as u16);
        if register.big_word_order { vec![high, low] } else { vec![low, high] }
    };
    match register.encoding {
        Encoding::U16 => vec![number.round() as u16],
        Encoding::I16 => vec![(number.round() as i16).cast_unsigned()],
        Encoding::U32 => double(number.round() as u32),
        Encoding::I32 => double((number.round() as i32).cast_unsigned()),
        Encoding::F32 => double((number as f32).to_bits()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(address: u16, input: bool, encoding: Encoding, big_word_order: bool) -> Place {
        Place { address, register: Register { input, encoding, big_word_order } }
    }

    #[test]
    fn neighbours_are_read_together_and_nothing_between_them() {
        let places = [
            place(12, true, Encoding::U16, true),
            place(10, true, Encoding::F32, true),
            place(14, true, Encoding::U16, true),
            place(13, false, Encoding::U16, true),
        ];
        let groups = group(&places);
        let of = |input, start, count, members: &[usize]| Group { input, start, count, members: members.to_vec() };
        assert_eq!(groups, [of(true, 10, 3, &[1, 0]), of(true, 14, 1, &[2]), of(false, 13, 1, &[3])]);
        let many: Vec<Place> = (0..130).map(|i| place(i, true, Encoding::U16, true)).collect();
        assert_eq!(group(&many).iter().map(|g| g.count).collect::<Vec<_>>(), [125, 5]);
        let top = [place(65_534, true, Encoding::U16, true), place(65_535, true, Encoding::U16, true)];
        assert_eq!(group(&top).len(), 1);
    }

    #[test]
    fn requests_for_as_many_registers_are_kept_apart() {
        let order = |counts: &[u16]| {
            let group =
                |(start, &count): (usize, &u16)| Group { input: true, start: start as u16, count, members: vec![] };
            let ordered = alternate(counts.iter().enumerate().map(group).collect());
            let mut starts: Vec<u16> = ordered.iter().map(|group| group.start).collect();
            starts.sort_unstable();
            assert!(starts.into_iter().eq(0..counts.len() as u16), "each of them once");
            ordered.iter().map(|group| group.count).collect::<Vec<_>>()
        };
        assert_eq!(order(&[1, 1, 2, 2]), [1, 2, 1, 2]);
        assert_eq!(order(&[2, 1, 1]), [1, 2, 1]);
        assert_eq!(order(&[3, 1, 2, 1, 1, 2]), [1, 2, 1, 2, 1, 3]);
        assert_eq!(order(&[4, 4, 4]), [4, 4, 4]);
        assert!(order(&[]).is_empty());
    }

    /// Words written down by hand: 123456.789 is 0x47F12065 as a 32-bit float, -2 in 32 bits is 0xFFFFFFFE.
    #[test]
    fn words_mean_what_the_encoding_says() {
        for (encoding, big, words_, number) in [
            (Encoding::U16, true, vec![0xFFFE], 65_534.0),
            (Encoding::I16, true, vec![0xFFFE], -2.0),
            (Encoding::U32, true, vec![0x0001, 0x0000], 65_536.0),
            (Encoding::U32, false, vec![0x0001, 0x0000], 1.0),
            (Encoding::I32, true, vec![0xFFFF, 0xFFFE], -2.0),
            (Encoding::F32, true, vec![0x47F1, 0x2065], f64::from(123_456.79_f32)),
            (Encoding::F32, false, vec![0x2065, 0x47F1], f64::from(123_456.79_f32)),
        ] {
            let place = place(7, true, encoding, big);
            assert_eq!(value(&place, 7, &words_), Some(number), "{encoding:?} {big}");
            assert_eq!(words(&place.register, number), words_, "{encoding:?} {big}");
            assert_eq!(value(&place, 7, &words_[1..]), None);
            assert_eq!(value(&place, 8, &words_), None);
        }
        assert_eq!(value(&place(0, true, Encoding::F32, true), 0, &[0x7FC0, 0]), None, "not a number");
    }
}
