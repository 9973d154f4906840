//! Numbers that are no values: those that stand for none, readings that fell out, and readings that stand still.

use std::collections::BTreeSet;

use crate::extent::ends;
use crate::recording::Series;
use crate::robust::NOT_BY_CHANCE;
use crate::storage::import::csv::missing::{Spellings, is_missing, missing};
use crate::storage::import::gaps::gaps;
use crate::storage::import::source::{Repair, SourceFile, counted};

/// Numbers that loggers write for no value: Campbell's, and the ends of a converter's range.
const NUMBERS: [f64; 8] = [-7999.0, 7999.0, 6999.0, 32767.0, -32768.0, 65535.0, 6553.5, 655.35];
/// Instruments write 9.9E+37 (SCPI), or the largest number of four bytes.
const ABOVE_ALL: f64 = 1e30;
/// A number is far outside of the rest where it lies so many times their spread, and so many times their size, away
/// from them.
const FAR: f64 = 10.0;
/// Values from which the spread of the rest is known.
const ENOUGH: usize = 20;

/// Whole numbers of two, three and four bytes.
const WORDS: [f64; 3] = [65_536.0, 16_777_216.0, 4_294_967_296.0];

/// Gives numbers their sign back that were written without it: whole ones that jump between the two ends of a word, and
/// are never near its middle.
pub(crate) fn take_signs(values: &mut [f64], name: &str) -> Option<Repair> {
    let read = || values.iter().copied().filter(|v| !v.is_nan());
    let most = read().fold(0.0, f64::max);
    let word = WORDS.into_iter().find(|word| most < *word && most >= 0.75 * word)?;
    let fits = read().all(|v| v >= 0.0 && v.fract() == 0.0 && !(0.25 * word..0.75 * word).contains(&v));
    let is_negative = |v: f64| v >= 0.75 * word;
    // the last count of a word alone stands for no value
    let negative: BTreeSet<u64> = read().filter(|v| is_negative(*v)).map(|v| v as u64).collect();
    if !fits || negative.len() < FEW || read().all(is_negative) {
        return None;
    }
    values.iter_mut().filter(|v| is_negative(**v)).for_each(|v| *v -= word);
    let text = format!("the numbers of '{name}' from {} on are negative ones, written without their sign", 0.75 * word);
    Some(Repair::guess("sign", text))
}

/// Takes readings out of a column that are none: those that fell out, and those that only repeat the one before.
pub(crate) fn take_unread(
    values: &mut [f64],
    lines: &[usize],
    name: &str,
    spellings: &mut Spellings,
) -> Option<Repair> {
    take_dropouts(values, lines, spellings);
    take_sparks(values, lines, spellings);
    take_repeats(values, name).or_else(|| take_held(values, lines, name))
}

/// Takes out of the tracks of other files than tables what is no value.
pub(crate) fn take_from(mut file: SourceFile) -> SourceFile {
    let mut spellings = Spellings::default();
    for track in &mut file.tracks {
        let Series { time_s, value, gaps: known } = &mut track.series;
        let places: Vec<usize> = (1..=value.len()).collect();
        take_sentinels(value, &places, &mut spellings);
        let repair = take_unread(value, &places, &track.name, &mut spellings);
        track.repairs.extend(repair.map(|repair| Repair { line: None, ..repair }));
        if value.iter().all(|v| !v.is_nan()) {
            continue;
        }
        let all = || time_s.iter().copied().zip(value.iter().copied());
        let missing_s: Vec<f64> = all().filter(|(_, v)| is_missing(*v)).map(|(t, _)| t).collect();
        let (times, values): (Vec<f64>, Vec<f64>) = all().filter(|(_, v)| !v.is_nan()).unzip();
        let mut gaps = gaps(&times, &missing_s);
        gaps.append(known);
        gaps.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
        track.series = Series { time_s: times, value: values, gaps };
    }
    file.repairs.extend(spellings.repair().map(|repair| Repair { line: None, ..repair }));
    file
}

/// Whether something in a column is no value.
pub(crate) fn has_strays(values: &[f64]) -> bool {
    let (mut left, lines) = (values.to_vec(), vec![0; values.len()]);
    let mut spellings = Spellings::default();
    take_sentinels(&mut left, &lines, &mut spellings);
    take_unread(&mut left, &lines, "", &mut spellings).is_some() || spellings.repair().is_some()
}

/// Takes the numbers that stand for no value out of a column. A number does where it lies far outside of all others and
/// is one that loggers use so, or comes again to the last digit.
pub(crate) fn take_sentinels(values: &mut [f64], lines: &[usize], spellings: &mut Spellings) {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan() && !is_known(*v)).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    // a value that stands for none is the least or the largest, however often it comes: the spread is that of the
    // others
    let ends = [sorted.first(), sorted.last()].map(|end| end.copied().unwrap_or(f64::NAN));
    let all = sorted.len();
    if all >= ENOUGH {
        sorted.retain(|v| !ends.contains(v));
    }
    let Some(last) = sorted.len().checked_sub(1) else { return };
    // The middle nine tenths, in which no few strays count.
    let (low, high) = (sorted[last / 20], sorted[last - last / 20]);
    let (spread, size) = (high - low, low.abs().max(high.abs()));
    // what loggers are known to write needs only be outside of the rest, and of its neighbours: a surge passes such
    // numbers, too
    let known_reach = spread.max(0.1 * size);
    let is_outside = |v: f64| is_known(v) && (v < low - known_reach || v > high + known_reach);
    let contradicted = |order: &mut dyn Iterator<Item = usize>| {
        let mut last = f64::INFINITY;
        let mut found = BTreeSet::new();
        for i in order.filter(|&i| !values[i].is_nan()) {
            if !is_known(values[i]) {
                last = values[i];
            } else if is_outside(values[i]) && (last - values[i]).abs() > known_reach {
                found.insert(i);
            }
        }
        found
    };
    let known = &contradicted(&mut (0..values.len())) & &contradicted(&mut (0..values.len()).rev());
    // a clipped peak has others near it, and of two levels each lasts
    let reach = FAR * spread.max(size);
    let comes_again = |end: f64| {
        let count = values.iter().filter(|v| **v == end).count();
        let alone = sorted.iter().chain(&ends).all(|v| *v == end || (v - end).abs() > reach);
        count > 1 && 20 * count <= all && alone
    };
    let strays: Vec<f64> = match spread > 0.0 && all >= ENOUGH {
        true => ends.into_iter().filter(|end| comes_again(*end)).collect(),
        false => Vec::new(),
    };
    for (i, (value, line)) in values.iter_mut().zip(lines).enumerate() {
        if known.contains(&i) || strays.contains(value) {
            spellings.count(&shown(*value), *line);
            *value = missing();
        }
    }
}

/// Nines, the ends of a range, or more than anything measures.
fn is_known(value: f64) -> bool {
    let is_nines = || {
        let digits: String = value.abs().to_string().chars().filter(|c| *c != '.').collect();
        let nines = digits.trim_end_matches('0');
        nines.len() >= 3 && nines.bytes().all(|b| b == b'9')
    };
    // three nines are nearly a power of ten: few numbers need be written out
    let power = 10_f64.powi(value.abs().log10().ceil() as i32);
    let is_near = value.abs() >= 99.0 && value.abs() > 0.998 * power;
    is_near && is_nines() || value.abs() >= ABOVE_ALL || NUMBERS.contains(&value)
}

fn shown(value: f64) -> String {
    if value.abs() >= 1e9 { format!("{value:e}") } else { value.to_string() }
}

/// Readings on end that fell out at once, one by one.
const FEW: usize = 3;
/// What lies outside of both neighbours by so many times what any other value does is contradicted by them.
const CONTRADICTED: f64 = 3.0;
/// And so large a part of the column's spread it is at least.
const LEAST_PART: f64 = 0.1;

/// Takes readings out that fell out, as a converter or a bus writes them: a zero, or one value that comes again at an
/// end of the range, which the neighbours on both sides contradict. The rest of the column never leaves its neighbours
/// so far for so short a time, or never steps so far.
fn take_dropouts(values: &mut [f64], lines: &[usize], spellings: &mut Spellings) {
    let read = values.iter().filter(|v| !v.is_nan());
    let (low, high) = ends(read.clone());
    let all = read.count();
    for stray in [0.0, low, high] {
        let count = values.iter().filter(|v| **v == stray).count();
        let is_few = count > usize::from(stray != 0.0) && 20 * count <= all;
        if is_few && all >= ENOUGH && is_contradicted(values, stray) {
            for (value, line) in values.iter_mut().zip(lines).filter(|(value, _)| **value == stray) {
                spellings.count(&shown(stray), *line);
                *value = missing();
            }
        }
    }
}

/// Takes single readings out that lie outside of both neighbours by more than all the rest ranges, several times: a
/// spark on the line.
fn take_sparks(values: &mut [f64], lines: &[usize], spellings: &mut Spellings) {
    let places: Vec<usize> = (0..values.len()).filter(|&i| !values[i].is_nan()).collect();
    let mut sorted: Vec<f64> = places.iter().map(|&i| values[i]).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(ENOUGH) else { return };
    let few = last / 200;
    let range = sorted[sorted.len() - 1 - few] - sorted[few];
    let is_spark = |w: &&[usize]| {
        let [before, at, after] = [w[0], w[1], w[2]].map(|i| values[i]);
        (before.min(after) - at).max(at - before.max(after)) > CONTRADICTED * range
    };
    let sparks: Vec<usize> = places.windows(3).filter(is_spark).map(|w| w[1]).collect();
    if range > 0.0 && sparks.len() <= few {
        sparks.into_iter().for_each(|i| {
            spellings.count(&shown(values[i]), lines[i]);
            values[i] = missing();
        });
    }
}

/// Whether the neighbours of a value contradict it somewhere.
fn is_contradicted(values: &[f64], stray: f64) -> bool {
    let read: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan()).collect();
    let others: Vec<f64> = read.iter().copied().filter(|v| *v != stray).collect();
    let (low, high) = ends(&others);
    // how far a few values on end lie outside of what stands before and after them, at most; and the largest step
    let apart = |length: usize| {
        let away = |w: &[f64]| {
            let (a, b) = (w[0].min(w[length + 1]), w[0].max(w[length + 1]));
            w[1..=length].iter().map(|v| (a - v).max(v - b)).fold(f64::INFINITY, f64::min)
        };
        others.windows(length + 2).map(away).fold(0.0, f64::max)
    };
    let apart: Vec<f64> = (1..=FEW).map(apart).collect();
    let step = others.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
    let mut from: usize = 0;
    // of two levels, as a trigger has, each lasts
    high > low
        && read.chunk_by(|a, b| (*a == stray) == (*b == stray)).any(|run| {
            let sides = [from.checked_sub(1).map(|at| read[at] - stray), read.get(from + run.len()).map(|v| v - stray)];
            from += run.len();
            let usual = match sides {
                // a peak that is cut off may be short as well
                [Some(_), Some(_)] if stray == 0.0 => apart.get(run.len() - 1).copied().unwrap_or(step),
                _ => step,
            };
            let sides: Vec<f64> = sides.into_iter().flatten().collect();
            let depth = sides.iter().map(|side| side * sides[0].signum()).fold(f64::INFINITY, f64::min);
            run[0] == stray && depth > CONTRADICTED * usual && depth > LEAST_PART * (high - low)
        })
}

/// So many equal values on end may be a sensor that stands still, and so many on either side tell its noise.
const LEAST_HELD: usize = 20;
/// Noise turns back as often, of all its steps; what moves without noise does not.
const TURNS_BACK: f64 = 0.15;

/// Takes a reading out but for its first value where it stands still for longer than chance makes it: it moves before
/// and after, and with noise on one side. What is cut off at the end of a range is none of these.
fn take_held(values: &mut [f64], lines: &[usize], name: &str) -> Option<Repair> {
    let places: Vec<usize> = (0..values.len()).filter(|&i| !values[i].is_nan()).collect();
    let read: Vec<f64> = places.iter().map(|&i| values[i]).collect();
    let (low, high) = ends(&read);
    // the share of equal neighbours, and whether the steps turn back as noise does
    let moves = |part: &[f64]| {
        let steps: Vec<f64> = part.windows(2).map(|w| w[1] - w[0]).collect();
        let turns = steps.windows(2).filter(|w| w[0] * w[1] < 0.0).count();
        let equal = steps.iter().filter(|s| **s == 0.0).count();
        ((equal as f64 + 0.5) / (steps.len() as f64 + 1.0), turns as f64 > TURNS_BACK * steps.len() as f64)
    };
    let stands_still = |from: usize, to: usize| {
        let reach = (to - from).max(LEAST_HELD);
        let before = from.checked_sub(LEAST_HELD).map(|_| moves(&read[from.saturating_sub(reach)..from]));
        let after = read.get(to..to + LEAST_HELD).map(|_| moves(&read[to..read.len().min(to + reach)]));
        before.zip(after).is_some_and(|((one, is_noise), (other, is_noise_after))| {
            let against = (to - from - 1) as f64 * -one.max(other).ln();
            (is_noise || is_noise_after) && against > (read.len() as f64).ln() + NOT_BY_CHANCE
        })
    };
    let mut held = Vec::new();
    let mut from = 0;
    for run in read.chunk_by(|a, b| a == b) {
        let to = from + run.len();
        if run.len() >= LEAST_HELD && low < run[0] && run[0] < high && stands_still(from, to) {
            held.push((from, to));
        }
        from = to;
    }
    let &(first, _) = held.first()?;
    let count = held.iter().map(|(from, to)| to - from - 1).sum();
    let text = format!(
        "'{name}' stands still at {}, while it moves and its noise goes on around that: {} recorded as a gap",
        read[first],
        counted(count, "value that repeats the one before is", "values that repeat the one before are")
    );
    held.iter().flat_map(|(from, to)| from + 1..*to).for_each(|at| values[places[at]] = missing());
    Some(Repair { lost: true, ..Repair::new("held", count, Some(lines[places[first]]), text) })
}

/// Changes by which a column shows that it was read more slowly than its table.
const LEAST_CHANGES: usize = 20;

/// Takes the repeats out of a column that was read more slowly than its table was written: each value stands there as
/// often as the others, or once more.
fn take_repeats(values: &mut [f64], name: &str) -> Option<Repair> {
    let places: Vec<usize> = (0..values.len()).filter(|&i| !values[i].is_nan()).collect();
    let runs: Vec<&[usize]> = places.chunk_by(|a, b| values[*a] == values[*b]).collect();
    let inner = runs.get(1..runs.len().saturating_sub(1)).filter(|inner| inner.len() >= LEAST_CHANGES)?;
    let mut lengths: Vec<usize> = inner.iter().map(|run| run.len()).collect();
    lengths.sort_unstable();
    let usual = lengths[lengths.len() / 20];
    let fits = lengths.iter().filter(|n| (usual..=usual + 1).contains(n)).count();
    if usual < 2 || 20 * fits < 19 * lengths.len() {
        return None;
    }
    let repeats: Vec<usize> = runs.iter().flat_map(|run| &run[1..]).copied().collect();
    let text = format!(
        "'{name}' was read more slowly than the table was written, its values come {usual} times each: the first of each is taken"
    );
    repeats.iter().for_each(|&i| values[i] = f64::NAN);
    // what happened in between, nobody knows
    Some(Repair { lost: true, ..Repair::new("repeats", repeats.len(), None, text) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pressure of some bar with `strays` in it.
    fn column(strays: &[(usize, f64)]) -> (Vec<f64>, String) {
        let mut values: Vec<f64> = (0..100).map(|i| 2.8 + 0.5 * f64::from(i).sin()).collect();
        strays.iter().for_each(|(at, v)| values[*at] = *v);
        let mut spellings = Spellings::default();
        take_sentinels(&mut values, &(1..=100).collect::<Vec<_>>(), &mut spellings);
        (values, spellings.repair().map_or(String::new(), |r| r.text))
    }

    #[test]
    fn a_number_stands_for_none_where_it_is_far_outside_and_known_or_comes_again() {
        for (stray, spelling) in
            [(-9999.0, "'-9999' 1 ×"), (9.9e37, "'9.9e37' 1 ×"), (-999.9, "'-999.9' 1 ×"), (7999.0, "'7999' 1 ×")]
        {
            let (values, said) = column(&[(4, stray)]);
            assert!(is_missing(values[4]) && said.contains(spelling), "{said}");
            assert_eq!(values.iter().filter(|v| v.is_nan()).count(), 1);
        }
        let (values, said) = column(&[(4, -500.25), (70, -500.25)]);
        assert!(is_missing(values[4]) && is_missing(values[70]) && said.contains("'-500.25' 2 ×"), "{said}");
        let mut few = [2.8, 2.9, -9999.0, 2.8];
        let mut spellings = Spellings::default();
        take_sentinels(&mut few, &[1, 2, 3, 4], &mut spellings);
        assert!(is_missing(few[2]) && few[3] == 2.8);
        // a block of them on end, at the beginning, within or at the end
        for from in [0, 50, 95] {
            let block: Vec<(usize, f64)> = (from..from + 5).map(|at| (at, -1234.5)).collect();
            let (values, said) = column(&block);
            assert!(values[from..from + 5].iter().all(|v| is_missing(*v)) && said.contains("5 ×"), "{said}");
        }
        // a sensor that shows no more than 100 has others near it
        let clipped: Vec<(usize, f64)> = [(40, 60.0), (41, 100.0), (42, 100.0), (43, 71.0)].to_vec();
        assert_eq!(column(&clipped).1, "");
        // a peak is a peak, also a high one, and so is a value that comes again near the rest
        assert_eq!(column(&[(4, 123.0)]).1, "");
        assert_eq!(column(&[(4, 9.99), (70, 9.99)]).1, "");
        // a surge that dies away passes the number 99.9
        let mut surge = [200.0; 400];
        surge[1..7].copy_from_slice(&[170.0, 130.0, 104.0, 99.9, 108.0, 150.0]);
        let mut spellings = Spellings::default();
        take_sentinels(&mut surge, &[1; 400], &mut spellings);
        assert!(surge[4] == 99.9 && spellings.repair().is_none());
        surge[9] = 999.9;
        take_sentinels(&mut surge, &[1; 400], &mut spellings);
        assert!(surge[9].is_nan() && spellings.repair().is_some());
        // pulses of a trigger, a flow that stops
        let mut pulses = [0.0; 100];
        (pulses[50], pulses[51]) = (5.0, 5.0);
        let mut spellings = Spellings::default();
        take_sentinels(&mut pulses, &[1; 100], &mut spellings);
        assert!(spellings.repair().is_none());
    }
}
