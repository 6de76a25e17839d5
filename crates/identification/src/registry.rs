//! What can be asked for by name: one entry gives name, sentence and constructor, and feeds help, JSON, scenario files and documents.

use std::boxed::Box;
use std::string::String;
use std::vec::Vec;

type Make<C, T, E> = Box<dyn Fn(&C) -> Result<Box<T>, E> + Send + Sync>;

struct Entry<C, T: ?Sized, E> {
    name: &'static str,
    sentence: &'static str,
    make: Make<C, T, E>,
}

/// Everything of one kind that can be asked for by name.
///
/// `C` is what a constructor is told (a problem, a flight), `T` the trait of what it makes, its auto traits included, and `E`
/// the error of a constructor.
pub struct Registry<C, T: ?Sized, E> {
    kind: &'static str,
    entries: Vec<Entry<C, T, E>>,
}

/// A name that no entry bears, with those that are known.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no {kind} is called `{asked}`; known: {}", known.join(", "))]
pub struct UnknownName {
    /// What was looked for: "method", "controller".
    pub kind: &'static str,
    /// The name asked for.
    pub asked: String,
    /// The names of all entries, in their order.
    pub known: Vec<&'static str>,
}

impl<C, T: ?Sized, E: From<UnknownName>> Registry<C, T, E> {
    /// An empty registry; `kind` names what it holds in messages.
    pub fn new(kind: &'static str) -> Self {
        Self { kind, entries: Vec::new() }
    }

    /// Adds an entry. One of the same name is replaced, so that users can put a better one in its place.
    #[must_use]
    pub fn with(
        mut self,
        name: &'static str,
        sentence: &'static str,
        make: impl Fn(&C) -> Result<Box<T>, E> + Send + Sync + 'static,
    ) -> Self {
        let entry = Entry { name, sentence, make: Box::new(make) };
        match self.entries.iter().position(|known| known.name == name) {
            Some(place) => self.entries[place] = entry,
            None => self.entries.push(entry),
        }
        self
    }

    /// Makes what bears this name.
    ///
    /// # Errors
    /// [`UnknownName`], which lists the known, and what the constructor says.
    pub fn make(&self, name: &str, about: &C) -> Result<Box<T>, E> {
        match self.entries.iter().find(|entry| entry.name == name) {
            Some(entry) => (entry.make)(about),
            None => Err(self.unknown(name).into()),
        }
    }

    /// The error of a name that no entry bears, or nothing.
    ///
    /// # Errors
    /// [`UnknownName`], which lists the known.
    pub fn check(&self, name: &str) -> Result<(), UnknownName> {
        if self.entries.iter().any(|entry| entry.name == name) { Ok(()) } else { Err(self.unknown(name)) }
    }

    /// Name and sentence of every entry, in the order of registration.
    pub fn entries(&self) -> impl Iterator<Item = (&'static str, &'static str)> + '_ {
        self.entries.iter().map(|entry| (entry.name, entry.sentence))
    }

    fn unknown(&self, name: &str) -> UnknownName {
        let known = self.entries.iter().map(|entry| entry.name).collect();
        UnknownName { kind: self.kind, asked: name.into(), known }
    }
}
