//! Elements of a model, with errors that name line and column.

use crate::FormatsError;
use crate::log::shortened;
use crate::text_file::printable;
use roxmltree::{Document, Node};
use std::ops::Range;
use std::path::Path;

/// No model nests deeper.
pub(super) const DEEPEST: usize = 200;

/// Nothing of a robot is larger, in whatever unit; products of such numbers are finite.
const LARGEST: f64 = 1e30;

/// The file around an element.
pub(super) struct Source<'a> {
    pub path: &'a Path,
    pub text: &'a str,
    /// Where each line begins, bytes.
    lines: Vec<usize>,
}

/// An element of a model.
#[derive(Clone, Copy)]
pub(super) struct Element<'a> {
    pub source: &'a Source<'a>,
    node: Node<'a, 'a>,
}

/// Hands the root element of a text to `read`.
pub(super) fn with_root<T>(
    path: &Path,
    text: &str,
    read: impl FnOnce(Element<'_>) -> Result<T, FormatsError>,
) -> Result<T, FormatsError> {
    let document = Document::parse(text).map_err(|error| {
        let remedy = match &error {
            roxmltree::Error::UnknownNamespace(prefix, _) if prefix == "xacro" => XACRO,
            roxmltree::Error::DtdDetected => "; a model needs none",
            _ => "",
        };
        FormatsError::BadModel {
            path: path.into(),
            line: error.pos().row as usize,
            column: error.pos().col as usize,
            message: printable(&error.to_string()).replace('\n', " ") + remedy,
        }
    })?;
    let lines = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
    let source = Source { path, text, lines };
    read(Element { source: &source, node: document.root_element() })
}

const XACRO: &str = "; expand the file with `xacro` first";

impl<'a> Element<'a> {
    /// An error at this element.
    pub fn bad(self, message: &str) -> FormatsError {
        let start = self.range().start;
        let line = self.line();
        let line_start = self.source.lines.get(line - 1).copied().unwrap_or(0);
        let column = self.source.text.get(line_start..start).unwrap_or_default().chars().count() + 1;
        let message = printable(message).replace('\n', " ");
        FormatsError::BadModel { path: self.source.path.into(), line, column, message }
    }

    pub fn tag(self) -> &'a str {
        self.node.tag_name().name()
    }

    /// Bytes of the whole element.
    pub fn range(self) -> Range<usize> {
        self.node.range()
    }

    /// Bytes of its name in its start tag.
    pub fn tag_range(self) -> Range<usize> {
        let start = self.range().start + 1;
        let written = self.source.text.get(start..).unwrap_or_default();
        let length = written.find(|c: char| c.is_whitespace() || c == '>' || c == '/').unwrap_or(written.len());
        start..start + length
    }

    /// Its line, from one.
    pub fn line(self) -> usize {
        let start = self.range().start;
        self.source.lines.partition_point(|line| *line <= start).max(1)
    }

    /// The elements in it.
    pub fn children(self) -> impl Iterator<Item = Self> {
        let source = self.source;
        self.node.children().filter(Node::is_element).map(move |node| Self { source, node })
    }

    pub fn of_tag(self, tag: &'static str) -> impl Iterator<Item = Self> {
        self.children().filter(move |child| child.tag() == tag)
    }

    /// The one child of this tag, if there is one.
    pub fn child(self, tag: &'static str) -> Result<Option<Self>, FormatsError> {
        let mut found = self.of_tag(tag);
        let first = found.next();
        match found.next() {
            Some(second) => Err(second.bad(&format!("a second `<{tag}>` in `<{}>`", shortened(self.tag())))),
            None => Ok(first),
        }
    }

    pub fn needed_child(self, tag: &'static str) -> Result<Self, FormatsError> {
        self.child(tag)?.ok_or_else(|| self.bad(&format!("`<{tag}>` is missing in `<{}>`", shortened(self.tag()))))
    }

    pub fn is_macro(self) -> bool {
        self.node.tag_name().namespace().is_some_and(|namespace| namespace.ends_with("xacro"))
    }

    pub fn text(self, attribute: &str) -> Option<&'a str> {
        self.node.attribute(attribute)
    }

    pub fn needed_text(self, attribute: &str) -> Result<&'a str, FormatsError> {
        self.text(attribute).filter(|text| !text.is_empty()).ok_or_else(|| self.missing(attribute))
    }

    fn missing(self, attribute: &str) -> FormatsError {
        self.bad(&format!("`<{}>` has no attribute `{attribute}`", shortened(self.tag())))
    }

    /// Bytes of the value of an attribute; empty where there is none.
    pub fn value_range(self, attribute: &str) -> Range<usize> {
        self.node.attribute_node(attribute).map_or(0..0, |attribute| attribute.range_value())
    }

    /// At most `MOST` finite numbers of a sensible size, those that are there.
    pub fn numbers<const MOST: usize>(self, attribute: &str) -> Result<Option<([f64; MOST], usize)>, FormatsError> {
        let Some(text) = self.text(attribute) else { return Ok(None) };
        let mut numbers = [0.0; MOST];
        let mut count = 0;
        for word in text.split_whitespace() {
            let number = word.parse().ok().filter(|number: &f64| number.abs() <= LARGEST);
            match (numbers.get_mut(count), number) {
                (Some(slot), Some(number)) => *slot = number,
                _ => return Err(self.no_numbers(attribute, text, MOST)),
            }
            count += 1;
        }
        Ok(Some((numbers, count)))
    }

    /// Exactly `COUNT` finite numbers.
    pub fn vector<const COUNT: usize>(self, attribute: &str) -> Result<Option<[f64; COUNT]>, FormatsError> {
        match self.numbers::<COUNT>(attribute)? {
            Some((numbers, count)) if count == COUNT => Ok(Some(numbers)),
            None => Ok(None),
            Some(_) => Err(self.no_numbers(attribute, self.text(attribute).unwrap_or_default(), COUNT)),
        }
    }

    pub fn number(self, attribute: &str) -> Result<f64, FormatsError> {
        self.vector::<1>(attribute)?.map(|[number]| number).ok_or_else(|| self.missing(attribute))
    }

    fn no_numbers(self, attribute: &str, text: &str, count: usize) -> FormatsError {
        let wanted = if count == 1 { "a finite number".to_owned() } else { format!("{count} finite numbers") };
        let wanted = format!("{wanted} up to {LARGEST:e}");
        let remedy = if text.contains("${") { XACRO } else { "" };
        let (tag, text) = (shortened(self.tag()), shortened(text));
        self.bad(&format!("`{attribute}` of `<{tag}>` is `{text}`, where the file needs {wanted}{remedy}"))
    }
}

/// Half a unit of the last digit of a number as it is written; zeros and whole numbers are taken to be exact.
pub(super) fn half_digit(word: &str) -> f64 {
    let (digits, exponent) = word.split_once(['e', 'E']).unwrap_or((word, "0"));
    let Some((_, decimals)) = digits.split_once('.').filter(|_| digits.contains(|c| ('1'..='9').contains(&c))) else {
        return 0.0;
    };
    let decimals = decimals.len();
    let decimals = i32::try_from(decimals).unwrap_or(i32::MAX);
    0.5 * 10_f64.powi(exponent.parse::<i32>().unwrap_or(0).saturating_sub(decimals))
}
