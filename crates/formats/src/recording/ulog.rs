//! PX4's ULog, read from front to back.
//!
//! A file describes its own messages: formats name their fields, subscriptions give a format a number, and data stand behind that number. What is
//! not known is passed over; a place where no message can begin is left by way of the next synchronisation mark. Memory is bounded by the limits
//! below whatever the file says.

mod layout;

pub use layout::{Kind, Layout, Number};

use super::scan_report::{Loss, ScanReport};
use crate::FormatsError;
use layout::Formats;
use std::collections::HashMap;
use std::io::Read;
use std::ops::ControlFlow;
use std::sync::Arc;

/// What every ULog begins with; one byte of version and eight of time follow.
pub const MAGIC: [u8; 7] = *b"ULog\x01\x12\x35";

const FILE_HEADER_BYTES: usize = 16;
/// Length (two bytes) and kind of a message.
const HEADER_BYTES: usize = 3;
/// A whole synchronisation message.
const SYNC: [u8; 11] = [8, 0, b'S', 0x2f, 0x73, 0x13, 0x20, 0x25, 0x0c, 0xbb, 0x12];
/// Bytes of the message of flags that are known; longer ones come from later versions.
const FLAG_BYTES: usize = 40;
/// The one incompatible feature that is read: data appended behind the end.
const DATA_APPENDED: u8 = 1;
/// Newest version of the format.
const VERSION: u8 = 1;

/// One message as it stands in a file.
#[derive(Clone, Copy, Debug)]
pub struct UlogMessage<'a> {
    /// Name and, for instances after the first, `/1` and so on.
    pub topic: &'a str,
    /// Name of the format.
    pub name: &'a str,
    /// Which of several of one name.
    pub instance: u8,
    /// When it was published, ns since the start of the computer.
    pub time_ns: i64,
    /// Where its fields stand.
    pub layout: &'a Layout,
    /// The fields.
    pub data: &'a [u8],
}

impl UlogMessage<'_> {
    /// A field by its path, such as `q[0]` or `esc[1].rpm`; `None` where it is not there.
    pub fn number(&self, path: &str) -> Option<Number> {
        self.layout.number(self.data, path)
    }

    /// A field as a real number, which may be no finite one.
    pub fn real(&self, path: &str) -> Option<f64> {
        self.number(path).map(Number::real)
    }
}

/// What a scan found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct UlogReport {
    /// Messages, bytes, losses.
    pub scan: ScanReport,
    /// How often the logger could not keep up.
    pub dropouts: u64,
    /// How long it did not, in all, ms.
    pub dropout_ms: u64,
}

/// Hands every message of a ULog on, in the order of the file, until `visit` breaks.
///
/// Of a torn file everything before the tear is handed on. A message that does not fit its format is left out.
///
/// # Errors
/// [`FormatsError::UnknownRecording`] where the file does not begin like a ULog, for later versions and for files that say that they
/// need a feature that is not known. Damage is no error: the report says it.
pub fn scan<R: Read>(
    source: R,
    visit: &mut dyn FnMut(&UlogMessage<'_>) -> ControlFlow<()>,
) -> Result<UlogReport, FormatsError> {
    let unknown = |reason: String| FormatsError::UnknownRecording { reason };
    let mut cursor = Cursor { source, buffer: Vec::new(), start: 0, at: 0, failure: None };
    let head = cursor.peek(FILE_HEADER_BYTES);
    let Some(&version) = head.strip_prefix(&MAGIC).and_then(<[u8]>::first) else {
        return Err(unknown("it does not begin as PX4's ULog does".to_owned()));
    };
    if version > VERSION {
        return Err(unknown(format!("a ULog of version {version}; those up to {VERSION} are read")));
    }
    let whole = head.len() == FILE_HEADER_BYTES;
    let mut scan = Scan {
        report: UlogReport::default(),
        formats: Formats::default(),
        subscribed: HashMap::new(),
        appended: Vec::new(),
        stopped: false,
        visit,
    };
    if whole {
        cursor.skip(FILE_HEADER_BYTES as u64);
        scan.messages(&mut cursor).map_err(unknown)?;
    } else {
        scan.lose(0, "the file ends within its header".to_owned(), true);
    }
    scan.report.scan.bytes = cursor.at;
    Ok(scan.report)
}

/// The file, with the place reached; never more of it in memory than one message and a half.
struct Cursor<R> {
    source: R,
    buffer: Vec<u8>,
    start: usize,
    at: u64,
    failure: Option<std::io::Error>,
}

impl<R: Read> Cursor<R> {
    /// Read at once.
    const STEP: u64 = 64 << 10;

    /// The next `count` bytes, fewer at the end of the file.
    fn peek(&mut self, count: usize) -> &[u8] {
        while self.buffer.len() - self.start < count && self.failure.is_none() {
            self.buffer.drain(..self.start);
            self.start = 0;
            match self.source.by_ref().take(Self::STEP).read_to_end(&mut self.buffer) {
                Ok(0) => break,
                Ok(_) => {}
                Err(error) => self.failure = Some(error),
            }
        }
        let end = self.buffer.len().min(self.start.saturating_add(count));
        self.buffer.get(self.start..end).unwrap_or_default()
    }

    /// Goes on by so many bytes, fewer at the end of the file.
    fn skip(&mut self, count: u64) {
        let mut left = count;
        while left > 0 {
            let step = usize::try_from(left.min(Self::STEP)).unwrap_or_default();
            let found = self.peek(step).len();
            if found == 0 {
                return;
            }
            self.start += found;
            self.at += found as u64;
            left -= found as u64;
        }
    }

    fn torn(&self) -> String {
        match &self.failure {
            Some(error) => format!("the file cannot be read further: {error}"),
            None => "the file ends within this message".to_owned(),
        }
    }
}

/// A message that a number stands for.
struct Subscribed {
    topic: String,
    name: String,
    instance: u8,
    layout: Arc<Layout>,
}

struct Scan<'v> {
    report: UlogReport,
    formats: Formats,
    subscribed: HashMap<u16, Subscribed>,
    /// Where appended parts begin that are still ahead, the next one last.
    appended: Vec<u64>,
    stopped: bool,
    visit: &'v mut dyn FnMut(&UlogMessage<'_>) -> ControlFlow<()>,
}

impl Scan<'_> {
    fn lose(&mut self, offset: u64, reason: String, ends_the_scan: bool) {
        self.report.scan.lose(Loss { offset, reason, ends_the_scan });
    }

    /// # Errors
    /// Which feature of the file is not known.
    fn messages<R: Read>(&mut self, cursor: &mut Cursor<R>) -> Result<(), String> {
        let mut is_first = true;
        while !self.stopped {
            let at = cursor.at;
            while self.appended.pop_if(|edge| *edge <= at).is_some() {}
            let edge = self.appended.last().copied();
            let head = cursor.peek(HEADER_BYTES);
            let &[low, high, kind] = head else {
                if !head.is_empty() || cursor.failure.is_some() {
                    let torn = cursor.torn();
                    self.lose(at, torn, true);
                }
                return Ok(());
            };
            let size = usize::from(u16::from_le_bytes([low, high]));
            let length = (HEADER_BYTES + size) as u64;
            // What was being written when the part behind was appended may be cut.
            if let Some(edge) = edge.filter(|edge| at + length > *edge) {
                cursor.skip(edge - at);
                continue;
            }
            if size == 0 || !kind.is_ascii_uppercase() {
                let found = synchronize(cursor, edge);
                self.lose(at, "no message begins here".to_owned(), !found);
                continue;
            }
            let message = cursor.peek(HEADER_BYTES + size);
            let Some(body) = message.get(HEADER_BYTES..).filter(|body| body.len() == size) else {
                let torn = cursor.torn();
                self.lose(at, torn, true);
                return Ok(());
            };
            if kind == b'B' && is_first {
                self.flags(body)?;
            } else if let Err(reason) = self.message(kind, body) {
                self.lose(at, reason, false);
            }
            is_first = false;
            cursor.skip(length);
        }
        Ok(())
    }

    fn flags(&mut self, body: &[u8]) -> Result<(), String> {
        let Some((flags, offsets)) = body.get(8..FLAG_BYTES).and_then(|known| known.split_at_checked(8)) else {
            self.lose(
                FILE_HEADER_BYTES as u64,
                format!("flags of {} bytes; there are {FLAG_BYTES}", body.len()),
                false,
            );
            return Ok(());
        };
        let is_known = |(i, flags): (usize, &u8)| if i == 0 { flags & !DATA_APPENDED == 0 } else { *flags == 0 };
        if !flags.iter().enumerate().all(is_known) {
            return Err("a ULog that needs a feature of a later version to be read".to_owned());
        }
        if flags.first().is_some_and(|flags| flags & DATA_APPENDED != 0) {
            let (offsets, _) = offsets.as_chunks::<8>();
            self.appended =
                offsets.iter().map(|bytes| u64::from_le_bytes(*bytes)).filter(|offset| *offset > 0).collect();
            self.appended.sort_unstable_by(|a, b| b.cmp(a));
        }
        Ok(())
    }

    /// # Errors
    /// Why it is left out.
    fn message(&mut self, kind: u8, body: &[u8]) -> Result<(), String> {
        match kind {
            b'F' => self.formats.add(body),
            b'A' => self.subscribe(body),
            b'R' => {
                if let [low, high, ..] = *body {
                    self.subscribed.remove(&u16::from_le_bytes([low, high]));
                }
                Ok(())
            }
            b'D' => self.data(body),
            b'O' => {
                let &[low, high, ..] = body else { return Err("a dropout without its duration".to_owned()) };
                self.report.dropouts += 1;
                self.report.dropout_ms += u64::from(u16::from_le_bytes([low, high]));
                Ok(())
            }
            // Information, parameters, text, marks, and what later versions have.
            _ => Ok(()),
        }
    }

    fn subscribe(&mut self, body: &[u8]) -> Result<(), String> {
        let &[instance, low, high, ref name @ ..] = body else {
            return Err("a subscription without a name".to_owned());
        };
        let name = layout::name(name)?;
        let layout = self.formats.layout(name)?;
        let topic = if instance == 0 { name.to_owned() } else { format!("{name}/{instance}") };
        let subscribed = Subscribed { topic, name: name.to_owned(), instance, layout };
        self.subscribed.insert(u16::from_le_bytes([low, high]), subscribed);
        Ok(())
    }

    fn data(&mut self, body: &[u8]) -> Result<(), String> {
        let &[low, high, ref data @ ..] = body else { return Err("data without a number".to_owned()) };
        let number = u16::from_le_bytes([low, high]);
        let Some(Subscribed { topic, name, instance, layout }) = self.subscribed.get(&number) else {
            return Err(format!("data of number {number}, which stands for nothing"));
        };
        if !layout.lengths().contains(&data.len()) {
            return Err(format!("{} bytes of {topic}; its format has {}", data.len(), layout.lengths().end()));
        }
        let time_us = match layout.number(data, "timestamp") {
            Some(Number::Unsigned(time_us)) => i64::try_from(time_us).ok(),
            _ => None,
        };
        let Some(time_ns) = time_us.and_then(|us| us.checked_mul(1000)) else {
            return Err(format!("a message of {topic} without a time that can be"));
        };
        self.report.scan.messages += 1;
        let message = UlogMessage { topic, name, instance: *instance, time_ns, layout, data };
        self.stopped = (self.visit)(&message).is_break();
        Ok(())
    }
}

/// Goes on to the next synchronisation message or the beginning of an appended part; `false` where the file ends before.
fn synchronize<R: Read>(cursor: &mut Cursor<R>, edge: Option<u64>) -> bool {
    loop {
        let ahead = edge.map_or(u64::MAX, |edge| edge.saturating_sub(cursor.at));
        if ahead == 0 {
            return true;
        }
        let window = cursor.peek(usize::try_from(ahead.min(Cursor::<R>::STEP)).unwrap_or_default());
        if let Some(mark) = window.windows(SYNC.len()).position(|window| window == SYNC) {
            cursor.skip(mark as u64);
            return true;
        }
        let seen = window.len() as u64;
        // The last bytes may begin a mark that goes on behind them.
        match seen.saturating_sub(SYNC.len() as u64 - 1) {
            0 => {
                cursor.skip(seen);
                return edge == Some(cursor.at);
            }
            step => cursor.skip(step),
        }
    }
}
