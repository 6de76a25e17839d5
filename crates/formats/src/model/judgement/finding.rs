//! What is found of a link, in words.

/// How sure it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Severity {
    /// Nothing is wrong: what one should know.
    Note,
    /// The evidence is clear, but it may be meant so.
    Suspect,
    /// It cannot be.
    Wrong,
}

impl Severity {
    /// As it is printed.
    pub fn name(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Suspect => "suspect",
            Self::Wrong => "wrong",
        }
    }
}

/// What a finding is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FindingKind {
    /// No body has these numbers.
    Impossible,
    /// Products of inertia of the other sign fit the shapes.
    Mirrored,
    /// Other axes fit the shapes.
    Swapped,
    /// Another order of the six numbers.
    Order,
    /// Another turn of the frame of the tensor.
    Axes,
    /// The tensor is about the origin of the link.
    AboutOrigin,
    /// Grams or millimetres.
    Units,
    /// A number to be replaced later.
    Placeholder,
    /// It moves, and there is no mass.
    Massless,
    /// The file says nothing of its mass.
    NotStated,
    /// More spread than its shapes allow, and no reading explains it.
    OutsideShapes,
}

impl FindingKind {
    /// As it is printed.
    pub fn name(self) -> &'static str {
        match self {
            Self::Impossible => "impossible",
            Self::Mirrored => "mirrored",
            Self::Swapped => "swapped",
            Self::Order => "order",
            Self::Axes => "axes",
            Self::AboutOrigin => "about-origin",
            Self::Units => "units",
            Self::Placeholder => "placeholder",
            Self::Massless => "massless",
            Self::NotStated => "not-stated",
            Self::OutsideShapes => "outside-shapes",
        }
    }
}

/// One thing about a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// How sure it is.
    pub severity: Severity,
    /// What it is about.
    pub kind: FindingKind,
    /// In words.
    pub message: String,
}

impl Finding {
    pub(super) fn new(severity: Severity, kind: FindingKind, message: impl Into<String>) -> Self {
        Self { severity, kind, message: message.into() }
    }
}

/// A share for people: what is less than that is nothing.
pub(super) fn percent(share: f64) -> String {
    if share < 1e-3 { "less than 0.1 %".to_owned() } else { format!("{} %", digits(100.0 * share)) }
}

/// Three significant digits.
pub(super) fn digits(number: f64) -> String {
    if number != 0.0 && !(1e-3..1e5).contains(&number.abs()) {
        return format!("{number:.2e}");
    }
    format!("{}", digits_of(number))
}

/// A number rounded to three significant digits.
pub(super) fn digits_of(number: f64) -> f64 {
    if number.abs() < 1e-12 || !number.is_finite() {
        return 0.0;
    }
    format!("{number:.2e}").parse().unwrap_or(number)
}
