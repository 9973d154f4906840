//! A law as a flat list of steps, each on the results of earlier ones.
//!
//! It is our own and not rhai, evalexpr or fasteval. rhai is a whole language with loops, whose scripts need limits on
//! time and memory, and it boxes every value. evalexpr and fasteval give numbers alone: a solver also needs the
//! derivative by the head, and the nodes of a wall want to be computed several at a time. The language has no loops and
//! no names of its own, so a parser and this list are shorter than what would wrap another crate, and every law ends
//! after as many steps as it has.

use crate::model::own::number::{Binary, Dual, Number, Unary};

/// One step; operands are the numbers of earlier steps.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Step {
    Number(f64),
    Input(usize),
    One(Unary, usize),
    Two(Binary, usize, usize),
    Choose(usize, usize, usize),
}

/// See the module.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Program {
    steps: Vec<Step>,
}

impl Program {
    /// Number of its steps.
    pub fn count(&self) -> usize {
        self.steps.len()
    }

    /// The value of a constant step.
    fn constant(&self, at: usize) -> Option<f64> {
        match self.steps[at] {
            Step::Number(value) => Some(value),
            _ => None,
        }
    }

    fn push(&mut self, step: Step) -> usize {
        // A step that is there already gives the same again.
        if let Some(at) = self.steps.iter().position(|s| *s == step) {
            return at;
        }
        self.steps.push(step);
        self.steps.len() - 1
    }

    /// Adds a constant; returns the step's number, as the functions below do.
    pub fn number(&mut self, value: f64) -> usize {
        self.push(Step::Number(value))
    }

    /// Adds an input.
    pub fn input(&mut self, input: usize) -> usize {
        self.push(Step::Input(input))
    }

    /// Adds a function of one number; of a constant it is computed at once.
    pub fn one(&mut self, f: Unary, a: usize) -> usize {
        match self.constant(a) {
            Some(a) => self.number(Dual::of(a).one(f).0),
            None => self.push(Step::One(f, a)),
        }
    }

    /// Adds a function of two numbers.
    pub fn two(&mut self, f: Binary, a: usize, b: usize) -> usize {
        match (self.constant(a), self.constant(b)) {
            (Some(a), Some(b)) => self.number(Dual::of(a).two(f, Dual::of(b)).0),
            _ => self.push(Step::Two(f, a, b)),
        }
    }

    /// Adds a choice between two numbers.
    pub fn choose(&mut self, c: usize, yes: usize, no: usize) -> usize {
        match self.constant(c) {
            Some(c) => {
                if c != 0.0 {
                    yes
                } else {
                    no
                }
            }
            None => self.push(Step::Choose(c, yes, no)),
        }
    }

    /// Makes `at` the result: steps behind it are none of its own.
    pub fn ending(mut self, at: usize) -> Program {
        self.steps.truncate(at + 1);
        self
    }

    /// The inputs that it reads.
    pub fn inputs(&self) -> impl Iterator<Item = usize> + '_ {
        self.steps.iter().filter_map(|s| if let Step::Input(i) = s { Some(*i) } else { None })
    }

    /// The same with values of some inputs given: what follows from them alone is computed once.
    pub fn bound(&self, given: impl Fn(usize) -> Option<f64>) -> Program {
        let mut program = Program::default();
        let mut at: Vec<usize> = Vec::with_capacity(self.steps.len());
        for step in &self.steps {
            at.push(match *step {
                Step::Number(value) => program.number(value),
                Step::Input(i) => match given(i) {
                    Some(value) => program.number(value),
                    None => program.input(i),
                },
                Step::One(f, a) => program.one(f, at[a]),
                Step::Two(f, a, b) => program.two(f, at[a], at[b]),
                Step::Choose(c, yes, no) => program.choose(at[c], at[yes], at[no]),
            });
        }
        let last = at.last().copied().unwrap_or(0);
        program.ending(last)
    }

    /// Its value; `scratch` is room for the steps, kept between calls so that none allocates.
    #[inline]
    pub fn run<T: Number>(&self, input: impl Fn(usize) -> T, scratch: &mut Vec<T>) -> T {
        scratch.clear();
        let mut value = T::of(0.0);
        for step in &self.steps {
            value = match *step {
                Step::Number(value) => T::of(value),
                Step::Input(i) => input(i),
                Step::One(f, a) => scratch[a].one(f),
                Step::Two(f, a, b) => scratch[a].two(f, scratch[b]),
                Step::Choose(c, yes, no) => scratch[c].choose(scratch[yes], scratch[no]),
            };
            scratch.push(value);
        }
        value
    }
}
