//! The same file with another inertia in it, everything else byte for byte.

use super::judgement::Verdict;
use super::links::{Inertial, Model, ModelKind, Written};
use crate::FormatsError;
use crate::body_file::{self, BodyFile};
use crate::log::shortened;
use crate::place::suggestion;
use std::ops::Range;
use std::path::Path;
use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::Matrix3;

/// A model whose impossible inertias are replaced by the nearest that bodies can have.
#[derive(Clone, Debug, PartialEq)]
pub struct Repaired {
    /// The file.
    pub text: String,
    /// Names of the links that were changed.
    pub links: Vec<String>,
    /// Names of those that cannot be and were left: no inertia mends their mass.
    pub left: Vec<String>,
}

impl Model {
    /// The text of the file with every impossible inertia replaced; the verdicts are those of [`judge`](super::judge) on this model.
    pub fn repaired(&self, verdicts: &[Verdict]) -> Repaired {
        let mut edits = Vec::new();
        let mut repaired = Repaired { text: String::new(), links: Vec::new(), left: Vec::new() };
        for (link, verdict) in self.links.iter().zip(verdicts) {
            if verdict.physical != Some(false) {
                continue;
            }
            match (&link.inertial, &verdict.nearest) {
                (Some(inertial), Some(nearest)) => {
                    edits.extend(tensor_edits(inertial, &nearest.inertia));
                    repaired.links.push(link.name.clone());
                }
                _ => repaired.left.push(link.name.clone()),
            }
        }
        repaired.text = self.edited(edits);
        repaired
    }

    /// The text of the file with this body in the link of that name; without a name in the only link that states a mass, or else in the only
    /// one that is on no other. Says which link that is.
    ///
    /// # Errors
    /// [`FormatsError::BadOption`]: no such link, or several that may be meant.
    pub fn with_body(
        &self,
        path: &Path,
        name: Option<&str>,
        body: &InertialParameters<f64>,
    ) -> Result<(String, String), FormatsError> {
        let index = self.link_meant(path, name)?;
        let Some(link) = self.links.get(index) else { return Ok((self.text.clone(), String::new())) };
        let body = BodyFile::from(body);
        let line_end = if self.text.contains("\r\n") { "\r\n" } else { "\n" };
        let element = |indent: &str| {
            let text = match self.kind {
                ModelKind::Urdf => body_file::urdf(&body),
                ModelKind::Mjcf => body_file::mjcf(&body),
            };
            text.trim_end().replace('\n', &format!("{line_end}{indent}"))
        };
        let edit = if let Some(inertial) = &link.inertial {
            let indent = self.indent(inertial.range.start);
            (inertial.range.clone(), element(&indent))
        } else {
            let outer = self.indent(link.range.start);
            let indent = format!("{outer}  ");
            let start_tag_end = self.start_tag_end(&link.range);
            let is_empty = self.text.get(..start_tag_end).is_some_and(|text| text.ends_with("/>"));
            let tag = self.text.get(link.tag.clone()).unwrap_or_default();
            let inside = format!("{line_end}{indent}{}", element(&indent));
            if is_empty {
                (start_tag_end - 2..start_tag_end, format!(">{inside}{line_end}{outer}</{tag}>"))
            } else {
                (start_tag_end..start_tag_end, inside)
            }
        };
        Ok((self.edited(vec![edit]), link.name.clone()))
    }

    fn link_meant(&self, path: &Path, name: Option<&str>) -> Result<usize, FormatsError> {
        let bad = |message: String| FormatsError::BadOption { message: format!("{}: {message}", path.display()) };
        if let Some(name) = name {
            let mut found = self.links.iter().enumerate().filter(|(_, link)| link.name == name);
            return match (found.next(), found.next()) {
                (Some((index, _)), None) => Ok(index),
                (Some(_), Some(_)) => Err(bad(format!("several links are called `{}`", shortened(name)))),
                (None, _) => {
                    let near = suggestion(name, self.links.iter().map(|link| link.name.as_str()));
                    Err(bad(format!("there is no link `{}`{near}", shortened(name))))
                }
            };
        }
        let only = |mut found: Box<dyn Iterator<Item = usize> + '_>| found.next().filter(|_| found.next().is_none());
        let stated = self.links.iter().enumerate().filter(|(_, link)| link.inertial.is_some());
        only(Box::new(stated.map(|(index, _)| index)))
            .or_else(|| only(Box::new(self.roots())))
            .ok_or_else(|| bad("several links may be meant: name one with `--link`".to_owned()))
    }

    /// The blanks in front of a byte on its line; nothing where more than blanks is there.
    fn indent(&self, at: usize) -> String {
        let before = self.text.get(..at).unwrap_or_default();
        let line = before.rsplit('\n').next().unwrap_or_default();
        if line.chars().all(|c| c == ' ' || c == '\t') { line.to_owned() } else { String::new() }
    }

    /// The byte after the start tag of an element.
    fn start_tag_end(&self, range: &Range<usize>) -> usize {
        let mut quote = None;
        for (at, c) in self.text.get(range.clone()).unwrap_or_default().char_indices() {
            match (quote, c) {
                (None, '"' | '\'') => quote = Some(c),
                (Some(open), _) if open == c => quote = None,
                (None, '>') => return range.start + at + 1,
                _ => {}
            }
        }
        range.end
    }

    /// The text with other words in places that do not overlap.
    fn edited(&self, mut edits: Vec<(Range<usize>, String)>) -> String {
        edits.sort_by_key(|(range, _)| range.start);
        let mut text = String::with_capacity(self.text.len());
        let mut done = 0;
        for (range, words) in edits {
            text.push_str(self.text.get(done..range.start).unwrap_or_default());
            text.push_str(&words);
            done = range.end;
        }
        text.push_str(self.text.get(done..).unwrap_or_default());
        text
    }
}

/// The values that write a tensor as the file writes it.
fn tensor_edits(inertial: &Inertial, inertia: &Matrix3<f64>) -> Vec<(Range<usize>, String)> {
    let j = inertia;
    match &inertial.written {
        Written::Named(ranges) => {
            let entries = [j.m11, j.m12, j.m13, j.m22, j.m23, j.m33];
            ranges.iter().cloned().zip(entries.map(|entry| entry.to_string())).collect()
        }
        Written::Full(range) => {
            let words = [j.m11, j.m22, j.m33, j.m12, j.m13, j.m23].map(|entry| entry.to_string());
            vec![(range.clone(), words.join(" "))]
        }
        Written::Diagonal(range) => {
            let words = [j.m11, j.m22, j.m33].map(|entry| entry.to_string());
            vec![(range.clone(), words.join(" "))]
        }
    }
}
