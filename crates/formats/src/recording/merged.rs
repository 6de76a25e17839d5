//! One recording in several files, such as NASA's `*_immediate.bag` and `*_delayed.bag`.
//!
//! Each file is scanned by a thread of its own, a few messages ahead; whichever has the earliest message goes on. Only topics that are
//! used travel, so that memory is bounded by the files' own chunks.

use super::{Container, Encoding, RawMessage, ScanReport, container, scan_file};
use crate::FormatsError;
use std::collections::{HashMap, VecDeque};
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// Each file may take two chunks of memory.
const MOST_FILES: usize = 16;
/// Messages, and bytes of them, that travel at once; one batch waits.
const BATCH: usize = 256;
const BATCH_BYTES: usize = 256 << 10;
/// No message that makes a flight is longer; what is, travels as an empty one, which holds no field.
const LONGEST_BYTES: usize = 1 << 20;
/// Messages among which doubles are looked for: some forty seconds of a robot.
const MOST_SEEN: usize = 8192;

/// Whether these files can be one recording.
///
/// # Errors
/// [`FormatsError::BadOption`] for too many and for a kind that is none of a recording in parts; as [`container`].
pub(super) fn check(paths: &[PathBuf]) -> Result<(), FormatsError> {
    let bad = |message: String| Err(FormatsError::BadOption { message });
    if paths.len() > MOST_FILES {
        return bad(format!("{} files; at most {MOST_FILES} are read as one recording", paths.len()));
    }
    let [_, _, ..] = paths else { return Ok(()) };
    for path in paths {
        let what = match container(path)? {
            Some(Container::Bag | Container::Mcap) => continue,
            Some(Container::Ulog) => "is a ULog, which is a recording of its own: identify each by itself",
            None => "is neither: put the rows of several CSV logs into one file, or name one log",
        };
        // What cannot be read at all says so itself.
        std::fs::File::open(path).map_err(|source| FormatsError::Unreadable { path: path.clone(), source })?;
        return bad(format!(
            "several files are one recording where they are bags or MCAP files; {} {what}",
            path.display()
        ));
    }
    Ok(())
}

/// A message that outlives its scan.
struct Owned {
    topic: String,
    type_name: String,
    md5: String,
    encoding: Encoding,
    log_time_ns: i64,
    payload: Vec<u8>,
}

impl Owned {
    fn of(raw: &RawMessage<'_>) -> Self {
        Self {
            topic: raw.topic.to_owned(),
            type_name: raw.type_name.to_owned(),
            md5: raw.md5.to_owned(),
            encoding: raw.encoding,
            log_time_ns: raw.log_time_ns,
            payload: Some(raw.payload).filter(|payload| payload.len() <= LONGEST_BYTES).unwrap_or_default().to_vec(),
        }
    }

    fn raw(&self) -> RawMessage<'_> {
        RawMessage {
            topic: &self.topic,
            type_name: &self.type_name,
            md5: &self.md5,
            encoding: self.encoding,
            log_time_ns: self.log_time_ns,
            payload: &self.payload,
        }
    }
}

/// One file, as far as it has come.
struct Stream {
    receiver: Receiver<Vec<Owned>>,
    batch: std::vec::IntoIter<Owned>,
    next: Option<Owned>,
}

impl Stream {
    fn advance(&mut self) -> Option<Owned> {
        let taken = self.next.take();
        self.next = self.batch.next().or_else(|| {
            // The thread has ended where nothing more comes.
            self.batch = self.receiver.recv().ok()?.into_iter();
            self.batch.next()
        });
        taken
    }
}

/// Scans a file and sends what is used of it, until nobody listens.
fn send(path: &Path, uses: &dyn Fn(&str) -> bool, sender: &SyncSender<Vec<Owned>>) -> Result<ScanReport, FormatsError> {
    let (mut batch, mut bytes) = (Vec::new(), 0);
    let report = scan_file(path, &mut |raw| {
        if !uses(raw.topic) {
            return ControlFlow::Continue(());
        }
        let message = Owned::of(&raw);
        bytes += message.payload.len();
        batch.push(message);
        if batch.len() < BATCH && bytes < BATCH_BYTES {
            return ControlFlow::Continue(());
        }
        bytes = 0;
        if sender.send(std::mem::take(&mut batch)).is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    })?;
    if !batch.is_empty() {
        // Nobody may listen any more.
        let _ = sender.send(batch);
    }
    Ok(report)
}

/// Hands the messages of all files on whose topics are used, the earliest recorded first, with the number of their file; gives the
/// report of each.
///
/// # Errors
/// As [`scan_file`] of the first file that has one.
pub(super) fn scan_files(
    paths: &[PathBuf],
    uses: &(dyn Fn(&str) -> bool + Sync),
    visit: &mut dyn FnMut(usize, RawMessage<'_>) -> ControlFlow<()>,
) -> Result<Vec<ScanReport>, FormatsError> {
    if let [path] = paths {
        return Ok(vec![scan_file(path, &mut |raw| visit(0, raw))?]);
    }
    std::thread::scope(|scope| {
        let (mut threads, mut streams) = (Vec::new(), Vec::new());
        for path in paths {
            let (sender, receiver) = sync_channel(1);
            threads.push(scope.spawn(move || send(path, uses, &sender)));
            streams.push(Stream { receiver, batch: Vec::new().into_iter(), next: None });
        }
        for stream in &mut streams {
            stream.advance();
        }
        loop {
            let heads = streams.iter().enumerate().filter_map(|(i, s)| Some((s.next.as_ref()?.log_time_ns, i)));
            let Some((_, file)) = heads.min() else { break };
            let Some(message) = streams.get_mut(file).and_then(Stream::advance) else { break };
            if visit(file, message.raw()).is_break() {
                break;
            }
        }
        // Whoever still sends finds that nobody listens.
        drop(streams);
        let gone = || FormatsError::UnknownRecording { reason: "its reader ended before it did".to_owned() };
        threads.into_iter().map(|thread| thread.join().unwrap_or_else(|_| Err(gone()))).collect()
    })
}

/// The latest messages of several files, by topic, stamp and content.
#[derive(Default)]
pub(super) struct Seen {
    files: HashMap<u64, usize>,
    order: VecDeque<u64>,
}

impl Seen {
    /// Whether another file has had the same bytes of the same topic and stamp lately; if not, it is remembered.
    pub(super) fn in_another(&mut self, file: usize, time_ns: i64, raw: &RawMessage<'_>) -> bool {
        let mut hasher = DefaultHasher::new();
        (raw.topic, time_ns, raw.payload).hash(&mut hasher);
        let key = hasher.finish();
        if let Some(first) = self.files.get(&key) {
            return *first != file;
        }
        self.files.insert(key, file);
        self.order.push_back(key);
        if self.order.len() > MOST_SEEN
            && let Some(oldest) = self.order.pop_front()
        {
            self.files.remove(&oldest);
        }
        false
    }
}
