//! What the program of a law counts with: a value with its derivative, or the values of several nodes at once.

/// Operations and functions of one number. Truth is 1, falsehood 0.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)] // named as in a law
pub enum Unary {
    Minus,
    Not,
    Abs,
    Sign,
    Sqrt,
    Exp,
    Ln,
    Sin,
    Cos,
}

/// Operations and functions of two numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)] // named as in a law
pub enum Binary {
    Plus,
    Minus,
    Times,
    By,
    Power,
    Min,
    Max,
    Less,
    AtMost,
    Equal,
    NotEqual,
    And,
    Or,
}

/// See the module.
pub trait Number: Copy {
    /// A constant.
    fn of(value: f64) -> Self;
    /// Function of one number.
    fn one(self, f: Unary) -> Self;
    /// Function of two numbers.
    fn two(self, f: Binary, other: Self) -> Self;
    /// `yes` where this is not zero, else `no`.
    fn choose(self, yes: Self, no: Self) -> Self;
}

/// Below this, the derivative of a square root stays what it is there: at zero it would be infinite.
const SMALL_ROOT: f64 = 1e-9;

/// A value and its derivative by one input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dual(pub f64, pub f64);

impl Number for Dual {
    #[inline]
    fn of(value: f64) -> Self {
        Dual(value, 0.0)
    }

    #[inline]
    fn one(self, f: Unary) -> Self {
        let Dual(x, d) = self;
        match f {
            Unary::Minus => Dual(-x, -d),
            Unary::Not => Dual(truth(x == 0.0), 0.0),
            Unary::Abs => Dual(x.abs(), if x < 0.0 { -d } else { d }),
            Unary::Sign => Dual(sign(x), 0.0),
            Unary::Sqrt => Dual(x.sqrt(), 0.5 * d / x.max(SMALL_ROOT).sqrt()),
            Unary::Exp => Dual(x.exp(), x.exp() * d),
            Unary::Ln => Dual(x.ln(), d / x),
            Unary::Sin => Dual(x.sin(), x.cos() * d),
            Unary::Cos => Dual(x.cos(), -x.sin() * d),
        }
    }

    #[inline]
    fn two(self, f: Binary, other: Self) -> Self {
        let (Dual(a, da), Dual(b, db)) = (self, other);
        match f {
            Binary::Plus => Dual(a + b, da + db),
            Binary::Minus => Dual(a - b, da - db),
            Binary::Times => Dual(a * b, da * b + a * db),
            Binary::By => Dual(a / b, (da - a / b * db) / b),
            Binary::Power => {
                let by_a = if da == 0.0 { 0.0 } else { b * a.powf(b - 1.0) * da };
                let by_b = if db == 0.0 { 0.0 } else { a.powf(b) * a.ln() * db };
                Dual(a.powf(b), by_a + by_b)
            }
            Binary::Min => {
                if b < a {
                    other
                } else {
                    self
                }
            }
            Binary::Max => {
                if b > a {
                    other
                } else {
                    self
                }
            }
            _ => Dual(compared(f, a, b), 0.0),
        }
    }

    #[inline]
    fn choose(self, yes: Self, no: Self) -> Self {
        if self.0 != 0.0 { yes } else { no }
    }
}

/// Nodes that are computed together.
pub const NODES: usize = 8;

/// The values of [`NODES`] nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wide(pub [f64; NODES]);

impl Wide {
    #[inline(always)]
    fn zip(self, other: Wide, f: impl Fn(f64, f64) -> f64) -> Wide {
        Wide(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }
}

impl Number for Wide {
    #[inline]
    fn of(value: f64) -> Self {
        Wide([value; NODES])
    }

    #[inline]
    fn one(self, f: Unary) -> Self {
        Wide(match f {
            Unary::Minus => self.0.map(|x| -x),
            Unary::Not => self.0.map(|x| truth(x == 0.0)),
            Unary::Abs => self.0.map(f64::abs),
            Unary::Sign => self.0.map(sign),
            Unary::Sqrt => self.0.map(f64::sqrt),
            Unary::Exp => self.0.map(f64::exp),
            Unary::Ln => self.0.map(f64::ln),
            Unary::Sin => self.0.map(f64::sin),
            Unary::Cos => self.0.map(f64::cos),
        })
    }

    #[inline]
    fn two(self, f: Binary, other: Self) -> Self {
        match f {
            Binary::Plus => self.zip(other, |a, b| a + b),
            Binary::Minus => self.zip(other, |a, b| a - b),
            Binary::Times => self.zip(other, |a, b| a * b),
            Binary::By => self.zip(other, |a, b| a / b),
            Binary::Power => self.zip(other, f64::powf),
            Binary::Min => self.zip(other, |a, b| if b < a { b } else { a }),
            Binary::Max => self.zip(other, |a, b| if b > a { b } else { a }),
            _ => self.zip(other, |a, b| compared(f, a, b)),
        }
    }

    #[inline]
    fn choose(self, yes: Self, no: Self) -> Self {
        Wide(std::array::from_fn(|i| if self.0[i] != 0.0 { yes.0[i] } else { no.0[i] }))
    }
}

#[inline]
fn truth(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}

/// -1, 0 or 1; `f64::signum` gives 1 for 0.
#[inline]
fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

#[inline]
fn compared(f: Binary, a: f64, b: f64) -> f64 {
    truth(match f {
        Binary::Less => a < b,
        Binary::AtMost => a <= b,
        Binary::Equal => a == b,
        Binary::NotEqual => a != b,
        Binary::And => a != 0.0 && b != 0.0,
        _ => a != 0.0 || b != 0.0,
    })
}
