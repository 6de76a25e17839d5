//! Logs that are no plain file: pipes, standard input, gzip.

use crate::FormatsError;
use flate2::read::MultiGzDecoder;
use std::fs::{self, File};
use std::io::{self, BufReader, ErrorKind, IsTerminal as _, Read, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// No log that comes through a pipe or out of a compressed file is longer, bytes.
const LIMIT_BYTES: u64 = 16 << 30;

/// How often `progress` is told, bytes.
const STEP_BYTES: u64 = 16 << 20;
/// What is no log shows it within so many bytes.
const HEAD_BYTES: u64 = 1 << 16;

/// A log that can be read as often as an estimator needs it: the file itself, or a copy of what is none, which is removed when this is dropped.
///
/// # Example
/// ```
/// use tumble_formats::LogFile;
/// let log = LogFile::of("Cargo.toml".as_ref(), &mut |_| {})?;
/// assert_eq!(log.path(), "Cargo.toml");
/// # Ok::<(), tumble_formats::FormatsError>(())
/// ```
#[derive(Debug)]
pub struct LogFile {
    named: PathBuf,
    path: PathBuf,
    copied_to: Option<PathBuf>,
}

impl LogFile {
    /// The log that a user named: `-` is standard input; named pipes are read to their end; gzip is taken off. `progress` is told how many bytes
    /// of such a log there are so far; of a pipe, first of all, that there is none yet: whoever is to write may keep it waiting. Of what cannot be a log
    /// only the beginning is copied, which whoever reads it refuses with its reason.
    ///
    /// # Errors
    /// [`FormatsError::Unreadable`], also for devices, for a terminal and for what is longer than 16 GiB.
    pub fn of(named: &Path, progress: &mut dyn FnMut(u64)) -> Result<Self, FormatsError> {
        Self::within(named, LIMIT_BYTES, progress)
            .map_err(|source| FormatsError::Unreadable { path: named.into(), source })
    }

    fn within(named: &Path, limit: u64, progress: &mut dyn FnMut(u64)) -> io::Result<Self> {
        if named == Path::new("-") {
            let stdin = io::stdin();
            if stdin.is_terminal() {
                return Err(refused("nothing is piped in"));
            }
            progress(0);
            return Self::copy(stdin.lock(), Path::new("standard-input"), limit, progress);
        }
        let kind = fs::metadata(named)?.file_type();
        if kind.is_dir() {
            return Err(ErrorKind::IsADirectory.into());
        }
        if !kind.is_file() && !is_pipe(kind) {
            return Err(refused("a device, not a log"));
        }
        let mut head = Vec::new();
        if kind.is_file() {
            File::open(named)?.take(2).read_to_end(&mut head)?;
            if head != GZIP {
                return Ok(Self { named: named.into(), path: named.into(), copied_to: None });
            }
        } else {
            progress(0);
        }
        Self::copy(File::open(named)?, named, limit, progress)
    }

    /// A place for a log that is made up: an empty file of this name, to be written before it is read, and removed when this is dropped.
    ///
    /// # Errors
    /// [`FormatsError::Unwritable`].
    pub fn to_write(named: &Path) -> Result<Self, FormatsError> {
        let file = Self::beside(named).and_then(|file| File::create(&file.path).map(|_| file));
        file.map_err(|source| FormatsError::Unwritable { path: named.into(), source })
    }

    /// A file of that name in a folder of its own, removed with it whatever comes.
    fn beside(named: &Path) -> io::Result<Self> {
        static COPIES: AtomicUsize = AtomicUsize::new(0);
        let folder = loop {
            let copy = COPIES.fetch_add(1, Ordering::Relaxed);
            let folder = std::env::temp_dir().join(format!("tumble-{}-{copy}", std::process::id()));
            match fs::create_dir(&folder) {
                // Left by a process of this number that was killed.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                created => break created.map(|()| folder)?,
            }
        };
        let name = if named.extension().is_some_and(|extension| extension == "gz") {
            named.file_stem()
        } else {
            named.file_name()
        };
        let path = folder.join(name.unwrap_or("log".as_ref()));
        Ok(Self { named: named.into(), path, copied_to: Some(folder) })
    }

    fn copy(source: impl Read, named: &Path, limit: u64, progress: &mut dyn FnMut(u64)) -> io::Result<Self> {
        let mut source = BufReader::new(source);
        let mut head = Vec::new();
        source.by_ref().take(2).read_to_end(&mut head)?;
        let is_compressed = head == GZIP;
        let whole = io::Cursor::new(head).chain(source);
        let mut plain: Box<dyn Read> =
            if is_compressed { Box::new(MultiGzDecoder::new(whole)) } else { Box::new(whole) };
        let copied = Self::beside(named)?;
        let mut file = File::create(&copied.path)?;
        let mut begin = Vec::new();
        plain.by_ref().take(HEAD_BYTES).read_to_end(&mut begin)?;
        let may_be_a_log = may_begin_a_log(&begin);
        let mut plain = io::Cursor::new(begin).chain(if may_be_a_log { plain } else { Box::new(io::empty()) });
        let (mut buffer, mut bytes) = (vec![0; 1 << 16], 0);
        loop {
            let count = match plain.read(&mut buffer) {
                Ok(0) => return Ok(copied),
                Ok(count) => count,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            };
            file.write_all(buffer.get(..count).unwrap_or_default())?;
            let before = bytes;
            bytes += count as u64;
            if bytes > limit {
                return Err(io::Error::new(ErrorKind::FileTooLarge, format!("longer than {limit} bytes")));
            }
            if before / STEP_BYTES != bytes / STEP_BYTES {
                progress(bytes);
            }
        }
    }

    /// The file to read.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// An error about it by the name that the user gave.
    #[must_use]
    pub fn by_name(&self, error: FormatsError) -> FormatsError {
        error.naming(&self.path, &self.named)
    }
}

impl Drop for LogFile {
    fn drop(&mut self) {
        if let Some(folder) = &self.copied_to {
            // It lies where the system clears up.
            let _ = fs::remove_dir_all(folder);
        }
    }
}

/// How gzip begins.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// How recordings begin, and UTF-16, which is refused by its name.
const BEGINNINGS: [&[u8]; 6] = [b"#ROSBAG", b"\x89MCAP", b"ULog", b"SQLite format 3", b"\xff\xfe", b"\xfe\xff"];

/// Whether a log may begin so: a recording, or text of which some line holds more than one cell.
fn may_begin_a_log(begin: &[u8]) -> bool {
    let separates = |byte: &u8| matches!(byte, b',' | b';' | b'\t' | b' ');
    let is_text = !begin.contains(&0) && begin.iter().any(separates);
    is_text || BEGINNINGS.iter().any(|beginning| begin.starts_with(beginning))
}

fn refused(why: &str) -> io::Error {
    io::Error::new(ErrorKind::InvalidInput, why)
}

#[cfg(unix)]
fn is_pipe(kind: fs::FileType) -> bool {
    use std::os::unix::fs::FileTypeExt as _;
    kind.is_fifo() || kind.is_socket()
}

#[cfg(not(unix))]
fn is_pipe(_: fs::FileType) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::scratch;
    use flate2::Compression;
    use flate2::write::GzEncoder;

    fn compressed(text: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(text).unwrap();
        encoder.finish().unwrap()
    }

    #[test]
    fn what_is_compressed_is_read_plain_and_leaves_nothing() {
        let path = scratch("gzip").join("flight.csv.gz");
        // Two members, as `cat a.gz b.gz` makes them.
        fs::write(&path, [compressed(b"t_s\n"), compressed(b"0.0\n")].concat()).unwrap();
        let log = LogFile::of(&path, &mut |_| {}).unwrap();
        assert_eq!(log.path().file_name().unwrap(), "flight.csv");
        assert_eq!(fs::read(log.path()).unwrap(), b"t_s\n0.0\n");
        let copied = log.path().to_owned();
        drop(log);
        assert!(!copied.exists() && !copied.parent().unwrap().exists());
    }

    #[test]
    fn what_is_made_up_is_kept_until_it_was_read() {
        let log = LogFile::to_write("made/up.toml".as_ref()).unwrap();
        fs::write(log.path(), "t_s\n").unwrap();
        assert_eq!(
            (fs::read_to_string(log.path()).unwrap().as_str(), log.path().file_name()),
            ("t_s\n", Some("up.toml".as_ref()))
        );
        let place = log.path().to_owned();
        drop(log);
        assert!(!place.exists() && !place.parent().unwrap().exists());
    }

    #[test]
    fn what_is_cut_or_too_long_is_refused() {
        let path = scratch("cut").join("flight.csv.gz");
        let whole = compressed(&[b'1'; 1000]);
        fs::write(&path, &whole[..whole.len() - 6]).unwrap();
        assert!(LogFile::of(&path, &mut |_| {}).is_err());
        fs::write(&path, &whole).unwrap();
        let error = LogFile::within(&path, 999, &mut |_| {}).unwrap_err();
        assert_eq!((error.kind(), error.to_string().as_str()), (ErrorKind::FileTooLarge, "longer than 999 bytes"));
        assert!(LogFile::within(&path, 1000, &mut |_| {}).is_ok());
    }

    #[test]
    fn of_what_is_no_log_the_beginning_is_copied_alone() {
        let length = |source: &[u8]| {
            let log = LogFile::copy(source, "log.csv".as_ref(), LIMIT_BYTES, &mut |_| {}).unwrap();
            fs::metadata(log.path()).unwrap().len()
        };
        let whole = 3 * HEAD_BYTES;
        let filled =
            |with: &[u8]| with.iter().copied().cycle().take(usize::try_from(whole).unwrap()).collect::<Vec<_>>();
        for nothing in [&b"y\n"[..], b"\0", b"\0,"] {
            assert_eq!(length(&filled(nothing)), HEAD_BYTES, "{nothing:?}");
        }
        for log in [&b"0.0,1.0\n"[..], b"0.0 1.0\n", b"#ROSBAG V2.0\n\0", b"\xff\xfet\0"] {
            assert_eq!(length(&filled(log)), whole, "{log:?}");
        }
        assert_eq!((length(b""), length(b"t_s\n")), (0, 4));
    }

    #[test]
    fn a_plain_file_is_itself_and_folders_and_devices_are_no_logs() {
        let folder = scratch("plain");
        fs::write(folder.join("a.csv"), "t_s\n").unwrap();
        assert_eq!(LogFile::of(&folder.join("a.csv"), &mut |_| {}).unwrap().path(), folder.join("a.csv"));
        assert!(LogFile::of(&folder, &mut |_| {}).is_err());
        assert!(LogFile::of(&folder.join("b.csv"), &mut |_| {}).is_err());
        #[cfg(unix)]
        assert!(LogFile::of("/dev/zero".as_ref(), &mut |_| {}).unwrap_err().to_string().contains("a device"));
    }
}
