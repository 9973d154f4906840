//! Which tasks are a runner's: one shard of several.

use std::str::FromStr;

/// Shard `number` of `of`; tasks go round.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// From 1.
    pub number: usize,
    /// How many there are.
    pub of: usize,
}

/// More are a slip.
const MOST: usize = 10_000_000;

impl Shard {
    /// Whether it has the task of this number, from 0.
    pub fn has(self, task: usize) -> bool {
        task % self.of == self.number - 1
    }

    /// The beginning of the names of its files.
    pub(crate) fn stem(self) -> String {
        format!("shard-{:04}-of-{:04}", self.number, self.of)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Shard, String> {
        let parts = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((number, of)) if (1..=of).contains(&number) && of <= MOST => Ok(Shard { number, of }),
            _ => Err("write it as I/N, from 1/N to N/N".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_task_is_in_one_shard() {
        for task in 0..1000 {
            let having = (1..=7).filter(|&number| Shard { number, of: 7 }.has(task)).count();
            assert_eq!(having, 1);
        }
        assert_eq!("3/200".parse(), Ok(Shard { number: 3, of: 200 }));
        for bad in ["0/3", "4/3", "1", "a/b", "", "1/0", "-1/3", "1/99999999"] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }
}
