//! What commands say, kept for a program that calls them in place of a terminal.

use std::cell::RefCell;
use std::fmt;
use std::io::{IsTerminal as _, Write as _};

/// What a command printed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Said {
    /// Its result: a table, or with `--json` one object.
    pub stdout: String,
    /// Warnings, and where it wrote what.
    pub stderr: String,
}

thread_local! {
    static KEPT: RefCell<Option<Said>> = const { RefCell::new(None) };
}

/// Puts back what was kept before, also where the work ends in a panic.
struct Before(Option<Said>);

impl Drop for Before {
    fn drop(&mut self) {
        KEPT.set(self.0.take());
    }
}

/// Does some work of this thread, and keeps what its commands print.
///
/// ```
/// let (printed, said) = tumble::cli::captured(|| tumble::cli::print("42\n"));
/// assert!(printed.is_ok());
/// assert_eq!(said.stdout, "42\n");
/// ```
pub fn captured<T>(work: impl FnOnce() -> T) -> (T, Said) {
    let before = Before(KEPT.replace(Some(Said::default())));
    let done = work();
    let said = KEPT.take().unwrap_or_default();
    drop(before);
    (done, said)
}

/// Whether a result was kept, and need not be printed.
pub(super) fn kept(text: &str) -> bool {
    KEPT.with_borrow_mut(|kept| kept.as_mut().map(|said| said.stdout.push_str(text)).is_some())
}

/// Says something on stderr. Where nobody listens, the work goes on.
pub(crate) fn told(text: fmt::Arguments<'_>) {
    let is_kept = KEPT.with_borrow_mut(|kept| {
        let Some(said) = kept else { return false };
        // What is formatted here are texts and numbers, none of which fails.
        fmt::write(&mut said.stderr, text).is_ok()
    });
    if !is_kept {
        let _ = std::io::stderr().lock().write_fmt(text);
    }
}

/// One line on stderr that replaces itself; silent in pipes.
pub(super) fn progress(text: &str) {
    if std::io::stderr().is_terminal() {
        tell!("\r{text:<60}{}", if text.is_empty() { "\r" } else { "" });
    }
}
