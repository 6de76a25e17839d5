//! What a program adds to the registries of this one: methods, estimators, planners, controllers of its own.

use std::sync::{Arc, PoisonError, RwLock};
use tumble_identification::{Registry, UnknownName};

type Make<C, T, E> = Arc<dyn Fn(&C) -> Result<Box<T>, E> + Send + Sync>;
/// Name, sentence, constructor.
type Entry<C, T, E> = (&'static str, &'static str, Make<C, T, E>);

/// Additions to one registry, for the whole process: a program makes them before it calls [`run`](crate::run), and what it adds can then be
/// asked for by name wherever the shipped ones can, in options, scenario files and replays.
///
/// # Example
/// ```
/// use tumble::cli::identify::ADDED_METHODS;
/// use tumble::robots::shipped;
/// use tumble_identification::Regressed;
///
/// ADDED_METHODS.add("mine", "Least squares under another name", |problem| Ok(Box::new(Regressed::new(*problem))));
/// let words = ["tumble", "identify", "--demo", "--method", "mine", "--json"].map(Into::into);
/// let answer = tumble::answer(words, &shipped())?;
/// assert!(answer.said.stdout.contains("mine"));
/// # Ok::<(), tumble::TumbleError>(())
/// ```
pub struct Added<C, T: ?Sized, E>(RwLock<Vec<Entry<C, T, E>>>);

impl<C: 'static, T: ?Sized + 'static, E: From<UnknownName> + 'static> Added<C, T, E> {
    pub(crate) const fn none() -> Self {
        Self(RwLock::new(Vec::new()))
    }

    /// Adds an entry, with a sentence for the help; one of a name that is there already takes its place.
    pub fn add(
        &self,
        name: &'static str,
        sentence: &'static str,
        make: impl Fn(&C) -> Result<Box<T>, E> + Send + Sync + 'static,
    ) {
        self.0.write().unwrap_or_else(PoisonError::into_inner).push((name, sentence, Arc::new(make)));
    }

    /// A registry with what was added so far.
    pub(crate) fn to(&self, registry: Registry<C, T, E>) -> Registry<C, T, E> {
        self.entries().into_iter().fold(registry, |registry, (name, sentence, make)| {
            registry.with(name, sentence, move |told: &C| make(told))
        })
    }

    pub(crate) fn entries(&self) -> Vec<Entry<C, T, E>> {
        self.0.read().unwrap_or_else(PoisonError::into_inner).clone()
    }
}
