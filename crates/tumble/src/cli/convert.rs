//! `tumble convert`: one log format into another.

use super::{Outcome, by_name, log_files, named_together, paths_of};
use crate::TumbleError;
use crate::output::OutputFile;
use std::fs::File;
use std::io::{BufWriter, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use tumble_formats::FormatsError;
use tumble_formats::Robots;
use tumble_formats::log::{cut_warning, shortened};
use tumble_formats::recording::mcap_log::{McapLog, McapSink};
use tumble_formats::recording::read_flight;
use tumble_formats::recording::rows::{CsvSink, RowSink, read_csv};
use tumble_formats::recording::tum::{self, TumSink};
use tumble_formats::recording::{self, Container};

/// Options of `tumble convert`.
#[derive(clap::Args, Clone, Debug)]
pub struct ConvertArgs {
    /// The log: CSV, TUM trajectory, MCAP, ROS 1 bag or PX4's ULog, known by how it begins, also packed by gzip or from a pipe; `-` is standard
    /// input. Several bags or MCAP files are one recording.
    #[arg(required = true, value_name = "INPUT")]
    pub inputs: Vec<PathBuf>,
    /// The file to write, named last; `-` is standard output.
    pub output: PathBuf,
    /// Format to write; otherwise the extension of OUTPUT says it: .csv, .mcap, .tum or .txt (TUM).
    #[arg(long, value_enum)]
    pub to: Option<Format>,
    /// Which robot's flight, where a bag or an MCAP file holds several.
    #[arg(long, value_name = "NAMESPACE")]
    pub robot: Option<String>,
    /// Replace OUTPUT where it exists.
    #[arg(long)]
    pub force: bool,
}

/// A format that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
#[non_exhaustive]
pub enum Format {
    /// Every column, as text.
    Csv,
    /// Every column, as `foxglove.*` and flat JSON messages.
    Mcap,
    /// Poses only: `t x y z qx qy qz qw`.
    Tum,
}

impl Format {
    fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "csv" => Some(Self::Csv),
            "mcap" => Some(Self::Mcap),
            "tum" | "txt" => Some(Self::Tum),
            _ => None,
        }
    }
}

/// What can be read, by how it begins.
enum Input {
    Csv,
    Tum,
    Recording(Container),
    /// One recording in several files.
    Several,
}

impl Input {
    fn of(paths: &[PathBuf]) -> Result<Self, TumbleError> {
        const HEAD_BYTES: u64 = 4096;
        let [path] = paths else { return Ok(Self::Several) };
        if let Some(container) = recording::container(path)? {
            return Ok(Self::Recording(container));
        }
        let mut head = Vec::new();
        open(path)?.take(HEAD_BYTES).read_to_end(&mut head).map_err(unreadable(path))?;
        let text = String::from_utf8_lossy(&head);
        let first = text.lines().find(|line| !line.trim().is_empty() && !line.starts_with('#'));
        Ok(if first.is_some_and(tum::is_first_line) { Self::Tum } else { Self::Csv })
    }
}

fn unreadable(path: &Path) -> impl FnOnce(std::io::Error) -> TumbleError + '_ {
    move |source| FormatsError::Unreadable { path: path.into(), source }.into()
}

fn open(path: &Path) -> Result<File, TumbleError> {
    let file = File::open(path).map_err(unreadable(path))?;
    if file.metadata().map_err(unreadable(path))?.is_dir() {
        return Err(unreadable(path)(ErrorKind::IsADirectory.into()));
    }
    Ok(file)
}

/// Converts.
///
/// # Errors
/// [`TumbleError`] for what cannot be read, held by the format or written; then nothing is left at the output.
pub fn run(args: &ConvertArgs, robots: &Robots) -> Result<Outcome, TumbleError> {
    let is_stdout = args.output.as_os_str() == "-";
    let Some(format) = args.to.or_else(|| Format::of(&args.output)) else {
        let known =
            if is_stdout { "say `--to csv` or `--to tum`" } else { "say `--to csv`, `--to mcap` or `--to tum`" };
        return Err(FormatsError::UnknownFormat { path: args.output.clone(), known }.into());
    };
    let files = log_files(&args.inputs)?;
    let args = &ConvertArgs { inputs: paths_of(&files), ..args.clone() };
    let input = Input::of(&args.inputs).map_err(|error| by_name(&files, error))?;
    let done = if is_stdout {
        if format == Format::Mcap {
            let known = "standard output takes CSV and TUM, which are text; name a file for MCAP";
            return Err(FormatsError::UnknownFormat { path: args.output.clone(), known }.into());
        }
        let mut out = BufWriter::new(std::io::stdout().lock());
        match convert(&input, args, robots, format, &mut out).and_then(|()| out.flush().map_err(refused)) {
            // A closed pipe (`tumble convert ... - | head`) is not an error.
            Err(TumbleError::File(FormatsError::Unwritable { source, .. }))
                if source.kind() == ErrorKind::BrokenPipe =>
            {
                // What is still buffered has nowhere to go.
                let _ = out.into_parts();
                Ok(())
            }
            done => done,
        }
    } else {
        OutputFile::create(&args.output, args.force).and_then(|mut out| {
            convert(&input, args, robots, format, &mut out)?;
            let place = out.finish()?;
            if place != args.output {
                tell_line!("{} appeared meanwhile and stays: wrote {}", args.output.display(), place.display());
            }
            Ok(())
        })
    };
    done.map_err(|error| by_name(&files, placed(error, &args.output))).map(|()| Outcome::Achieved)
}

fn refused(source: std::io::Error) -> TumbleError {
    FormatsError::Unwritable { path: PathBuf::new(), source }.into()
}

/// Names the output in what a writer said, which does not know it.
fn placed(error: TumbleError, output: &Path) -> TumbleError {
    match error {
        TumbleError::File(FormatsError::Unwritable { source, .. }) => {
            FormatsError::Unwritable { path: output.into(), source }.into()
        }
        TumbleError::File(FormatsError::NotHeld { format, what, .. }) => {
            FormatsError::NotHeld { path: output.into(), format, what }.into()
        }
        other => other,
    }
}

fn convert(
    input: &Input,
    args: &ConvertArgs,
    robots: &Robots,
    format: Format,
    out: &mut dyn Write,
) -> Result<(), TumbleError> {
    match format {
        Format::Csv => read(input, args, robots, &mut CsvSink::new(out)),
        Format::Mcap => {
            let mut sink = McapSink::new(out)?;
            read(input, args, robots, &mut sink)?;
            Ok(sink.finish().map(|_| ())?)
        }
        Format::Tum => {
            let mut sink = TumSink::new(out);
            read(input, args, robots, &mut sink)?;
            say_left_out(&sink);
            Ok(())
        }
    }
}

fn say_left_out<W: Write>(sink: &TumSink<W>) {
    let (columns, rows) = sink.left_out();
    if let Some(first) = columns.first() {
        let count = columns.len();
        tell_line!("warning: TUM holds poses only; {count} other columns are left out, `{}` first", shortened(first));
    }
    if rows > 0 {
        tell_line!("warning: {rows} rows without a pose are left out");
    }
}

fn read(input: &Input, args: &ConvertArgs, robots: &Robots, sink: &mut dyn RowSink) -> Result<(), TumbleError> {
    if let [path] = args.inputs.as_slice() {
        if matches!(input, Input::Csv | Input::Tum)
            && let Some(warning) = cut_warning(path)
        {
            tell_line!("warning: {}: {warning}", path.display());
        }
        match input {
            Input::Csv => return Ok(read_csv(path, sink)?),
            Input::Tum => return Ok(tum::read(path, sink)?),
            Input::Recording(Container::Mcap) => {
                // A log of ours keeps every column; of what others record, the flight is assembled.
                let (log, report) = McapLog::survey(open(path)?)?;
                if !log.columns.is_empty() {
                    tell!("{}", report.table(path));
                    return read_mcap(path, &log, sink);
                }
            }
            Input::Recording(_) | Input::Several => {}
        }
    }
    let named = named_together(&args.inputs);
    for warning in read_flight(&args.inputs, args.robot.as_deref(), robots, sink)? {
        tell_line!("warning: {named}: {warning}");
    }
    Ok(())
}

fn read_mcap(path: &Path, log: &McapLog, sink: &mut dyn RowSink) -> Result<(), TumbleError> {
    if log.unread > 0 {
        tell_line!("warning: {}: {} messages do not hold what their type says", path.display(), log.unread);
    }
    let without_pose = log.rows(open(path)?, sink)?;
    if without_pose > 0 {
        tell_line!("warning: {}: {without_pose} rows without a pose are left out", path.display());
    }
    Ok(())
}
