//! Files appear whole or not at all.

use crate::TumbleError;
use std::fs;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;
use tumble_formats::FormatsError;

fn unwritable(path: &Path) -> impl FnOnce(std::io::Error) -> TumbleError + '_ {
    move |source| FormatsError::Unwritable { path: path.into(), source }.into()
}

/// What follows the name of an unfinished output, before the number of its process.
const PARTIAL: &str = ".partial-";
/// An unfinished output is left over after this long, where processes cannot be asked for.
const STALE: Duration = Duration::from_secs(24 * 3600);

/// A sibling of `path` that no other process uses.
fn partial_sibling(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!("{PARTIAL}{}", std::process::id()));
    path.with_file_name(name)
}

/// Removes the unfinished folders, or files, of `path` that processes left which were ended; what cannot be removed stays.
fn remove_stale_partials(path: &Path, folders: bool) {
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else { return };
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let process = |entry: &fs::DirEntry| -> Option<u32> {
        entry.file_name().to_str()?.strip_prefix(name)?.strip_prefix(PARTIAL)?.parse().ok()
    };
    for entry in fs::read_dir(parent).into_iter().flatten().flatten() {
        // Of links not even the target.
        let is_such = entry.file_type().is_ok_and(|kind| if folders { kind.is_dir() } else { kind.is_file() });
        if is_such && process(&entry).is_some_and(|process| is_over(process, &entry)) {
            let _ = if folders { fs::remove_dir_all(entry.path()) } else { fs::remove_file(entry.path()) };
        }
    }
}

/// Whether the process that wrote `entry` is no more; where that cannot be asked, whether it is long ago.
fn is_over(process: u32, entry: &fs::DirEntry) -> bool {
    let processes = Path::new("/proc");
    if processes.join("self").exists() {
        return !processes.join(process.to_string()).exists();
    }
    let written = entry.metadata().and_then(|data| data.modified());
    written.is_ok_and(|written| written.elapsed().is_ok_and(|age| age > STALE))
}

/// Writes one file under a temporary name and renames it when complete.
///
/// # Errors
/// [`TumbleError::OutputExists`] without `force`; [`FormatsError::Unwritable`].
pub fn write_file(path: &Path, contents: &[u8], force: bool) -> Result<(), TumbleError> {
    if path.exists() && !force {
        return Err(TumbleError::OutputExists { path: path.into() });
    }
    let partial = partial_sibling(path);
    let written = fs::write(&partial, contents).and_then(|()| place_file(&partial, path, force));
    if written.is_err() {
        // The partial file is worthless; that it may not exist is fine.
        let _ = fs::remove_file(&partial);
    }
    written.map_err(|source| match source.kind() {
        ErrorKind::AlreadyExists => TumbleError::OutputExists { path: path.into() },
        _ => unwritable(path)(source),
    })
}

/// Gives a finished file its name; without `force` never in the place of another, however late that appeared.
fn place_file(partial: &Path, path: &Path, force: bool) -> std::io::Result<()> {
    if force {
        return fs::rename(partial, path);
    }
    // A second name is refused where the name is taken, which a change of the name is not.
    match fs::hard_link(partial, path) {
        Ok(()) => fs::remove_file(partial),
        Err(error) if error.kind() == ErrorKind::AlreadyExists || path.symlink_metadata().is_ok() => {
            Err(ErrorKind::AlreadyExists.into())
        }
        // Not every file system knows second names.
        Err(_) => fs::rename(partial, path),
    }
}

/// A file that is written bit by bit and appears under its name only when [`OutputFile::finish`] is called; dropped
/// before, it leaves nothing.
pub struct OutputFile {
    path: PathBuf,
    partial: PathBuf,
    force: bool,
    file: BufWriter<fs::File>,
}

impl OutputFile {
    /// Begins to write.
    ///
    /// # Errors
    /// [`TumbleError::OutputExists`] without `force`; [`FormatsError::Unwritable`].
    pub fn create(path: &Path, force: bool) -> Result<Self, TumbleError> {
        if path.exists() && !force {
            return Err(TumbleError::OutputExists { path: path.into() });
        }
        remove_stale_partials(path, false);
        let partial = partial_sibling(path);
        let file = fs::File::create(&partial).map_err(unwritable(path))?;
        Ok(Self { path: path.into(), partial, force, file: BufWriter::new(file) })
    }

    /// Lets the file appear under its name, or under the next one that is free where another file has taken it meanwhile; says which.
    ///
    /// # Errors
    /// [`FormatsError::Unwritable`]; an older file is then still there.
    pub fn finish(mut self) -> Result<PathBuf, TumbleError> {
        self.file.flush().map_err(unwritable(&self.path))?;
        let stem = self.path.file_stem().unwrap_or_default();
        let numbered = |number: u32| {
            let mut name = stem.to_os_string();
            name.push(format!("-{number}"));
            let mut path = self.path.with_file_name(name);
            if let Some(extension) = self.path.extension() {
                path.as_mut_os_string().push(".");
                path.as_mut_os_string().push(extension);
            }
            path
        };
        let mut taken = 1;
        loop {
            let path = if taken == 1 { self.path.clone() } else { numbered(taken) };
            match place_file(&self.partial, &path, self.force) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => taken += 1,
                placed => return placed.map(|()| path).map_err(unwritable(&self.path)),
            }
        }
    }
}

impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.file.write(bytes)
    }
    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

impl Drop for OutputFile {
    fn drop(&mut self) {
        // Finished, it is no longer there under this name.
        let _ = fs::remove_file(&self.partial);
    }
}

/// Whether `path` is a folder in which nothing lies but what this program wrote, or nothing at all: only such a folder may
/// be replaced.
fn is_result_folder(path: &Path) -> bool {
    let is_folder = path.symlink_metadata().is_ok_and(|data| data.is_dir());
    let Ok(entries) = fs::read_dir(path) else { return false };
    let mut names =
        entries.map(|entry| entry.map(|e| e.file_name().to_string_lossy().into_owned()).unwrap_or_default());
    let is_empty = || fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_none());
    is_folder
        && (path.join(RUN_RECORD).is_file() && names.all(|name| RESULT_FILES.contains(&name.as_str())) || is_empty())
}

/// The file by which a result folder is known.
pub const RUN_RECORD: &str = "run.json";
/// Everything that lies in a result folder.
const RESULT_FILES: [&str; 55] = [
    RUN_RECORD,
    "result.json",
    "body.toml",
    "report.html",
    "residual_force.svg",
    "residual_torque.svg",
    "harmonics.svg",
    "summary.json",
    "excitation.toml",
    "motion.csv",
    "log.csv",
    "log.mcap",
    "truth.toml",
    "actuators.toml",
    "position.svg",
    "attitude.svg",
    "position_rate.svg",
    "attitude_rate.svg",
    "position_acceleration.svg",
    "attitude_acceleration.svg",
    "force.svg",
    "torque.svg",
    "path_xy.svg",
    "path_xz.svg",
    "scenario.toml",
    "timings.json",
    "force_x.svg",
    "force_y.svg",
    "force_z.svg",
    "torque_x.svg",
    "torque_y.svg",
    "torque_z.svg",
    "plan.csv",
    "plan.json",
    "plan_top.svg",
    "plan_side.svg",
    "local_plan.csv",
    "local_plan.json",
    "local_top.svg",
    "local_side.svg",
    "local_motion.svg",
    "local_inputs.svg",
    "local_sigma.svg",
    "tracking.svg",
    "mass.svg",
    "rows.csv",
    "rows.parquet",
    "clearance.svg",
    "tracking_error.svg",
    "mission_time.svg",
    "impulse.svg",
    "error_mass.svg",
    "error_inertia_zz.svg",
    "attitude_error.svg",
    "sensing.json",
];

/// The first of `base`, `base-2`, `base-3`, ... where nothing is yet.
pub fn unused(base: &Path) -> PathBuf {
    let numbered = |number: u32| {
        let mut name = base.as_os_str().to_os_string();
        name.push(format!("-{number}"));
        PathBuf::from(name)
    };
    let mut candidates = std::iter::once(base.to_path_buf()).chain((2..).map(numbered));
    candidates.find(|path| path.symlink_metadata().is_err()).unwrap_or_else(|| base.to_path_buf())
}

/// A folder that appears under its name only when [`OutputFolder::finish`] is called; dropped before, it leaves nothing.
pub struct OutputFolder {
    path: PathBuf,
    partial: PathBuf,
    /// The folder above, where it was not there before.
    made: Option<PathBuf>,
    force: bool,
    finished: bool,
}

impl OutputFolder {
    /// Whether a result may appear at `path`: nothing is there, or with `force` an earlier result.
    ///
    /// # Errors
    /// As [`OutputFolder::create`].
    pub fn check_place(path: &Path, force: bool) -> Result<(), TumbleError> {
        if path.symlink_metadata().is_err() || (force && is_result_folder(path)) {
            return Ok(());
        }
        let path = path.into();
        Err(if force { TumbleError::NotAResult { path } } else { TumbleError::OutputExists { path } })
    }

    /// Prepares `path`.
    ///
    /// # Errors
    /// [`TumbleError::OutputExists`] without `force`; [`TumbleError::NotAResult`] with `force` for anything but an
    /// earlier result; [`FormatsError::Unwritable`].
    pub fn create(path: &Path, force: bool) -> Result<Self, TumbleError> {
        if path.file_name().is_none() {
            return Err(TumbleError::BadOption {
                message: format!("`--out {}` is not the name of a folder", path.display()),
            });
        }
        Self::check_place(path, force)?;
        remove_stale_partials(path, true);
        let partial = partial_sibling(path);
        if partial.exists() {
            fs::remove_dir_all(&partial).map_err(unwritable(&partial))?;
        }
        let above = partial.parent().filter(|above| !above.as_os_str().is_empty() && !above.exists());
        let made = above.map(Path::to_path_buf);
        fs::create_dir_all(&partial).map_err(unwritable(path))?;
        // Without a slash at the end, which would be doubled in the names of the files.
        Ok(Self { path: path.components().collect(), partial, made, force, finished: false })
    }

    /// Where a picture named `name` is drawn before the folder is finished.
    pub fn file(&self, name: &str) -> PathBuf {
        self.partial.join(name)
    }

    /// Writes one file into the folder.
    ///
    /// # Errors
    /// [`FormatsError::Unwritable`].
    pub fn write(&self, name: &str, contents: &str) -> Result<(), TumbleError> {
        let path = self.file(name);
        fs::write(&path, contents).map_err(unwritable(&self.path))
    }

    /// Lets the folder appear under its name, with `force` in the place of an older result. Where something else has taken the name
    /// meanwhile, it appears as `-2`, `-3`, ...; says where.
    ///
    /// # Errors
    /// [`FormatsError::Unwritable`]; the older folder is then still there.
    pub fn finish(mut self) -> Result<PathBuf, TumbleError> {
        let is_replaced = self.force && is_result_folder(&self.path);
        let replaced = is_replaced.then(|| {
            let mut name = self.path.file_name().unwrap_or_default().to_os_string();
            name.push(format!(".replaced-{}", std::process::id()));
            self.path.with_file_name(name)
        });
        if let Some(old) = &replaced {
            fs::rename(&self.path, old).map_err(unwritable(&self.path))?;
        }
        let place = loop {
            let place = unused(&self.path);
            match fs::rename(&self.partial, &place) {
                Ok(()) => break place,
                // Taken between the question and the answer.
                Err(_) if place.symlink_metadata().is_ok() => {}
                Err(source) => {
                    if let Some(old) = &replaced {
                        let _ = fs::rename(old, &self.path);
                    }
                    return Err(FormatsError::Unwritable { path: self.path.clone(), source }.into());
                }
            }
        };
        self.finished = true;
        if let Some(old) = &replaced {
            fs::remove_dir_all(old).map_err(unwritable(old))?;
        }
        Ok(place)
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        if !self.finished {
            // Nothing more can be done about a folder that cannot be removed.
            let _ = fs::remove_dir_all(&self.partial);
            // Where others have put something there meanwhile it stays.
            let _ = self.made.as_ref().map(fs::remove_dir);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_formats::testing::scratch;

    #[test]
    fn an_unfinished_folder_leaves_nothing() {
        let base = scratch("unfinished");
        let folder = OutputFolder::create(&base.join("run"), false).unwrap();
        folder.write("a.txt", "a").unwrap();
        drop(folder);
        assert_eq!(fs::read_dir(&base).unwrap().count(), 0);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn what_ended_processes_left_is_removed() {
        let base = scratch("stale");
        // No process has the largest number; the first process always runs.
        let stale = [format!("run.partial-{}", u32::MAX), format!("run.partial-{}", u32::MAX - 1)];
        let kept = [
            "run.partial-1".to_owned(),
            "run.partial-notes".to_owned(),
            format!("other.partial-{}", u32::MAX),
            "run.replaced-4294967295".to_owned(),
        ];
        for name in stale.iter().chain(&kept) {
            fs::create_dir(base.join(name)).unwrap();
            fs::write(base.join(name).join("log.csv"), "torn").unwrap();
        }
        let file = base.join("run.partial-4294967290");
        fs::write(&file, "a file is no folder").unwrap();
        drop(OutputFolder::create(&base.join("run"), false).unwrap());
        assert!(stale.iter().all(|name| !base.join(name).exists()));
        assert!(kept.iter().all(|name| base.join(name).join("log.csv").exists()) && file.exists());
        drop(OutputFile::create(&base.join("run"), false).unwrap());
        assert!(kept.iter().all(|name| base.join(name).join("log.csv").exists()) && !file.exists());
    }

    #[test]
    fn an_existing_folder_is_refused_and_replaced_only_by_force() {
        let base = scratch("existing");
        let path = base.join("run");
        let first = OutputFolder::create(&path, false).unwrap();
        first.write("run.json", "{}").unwrap();
        first.write("body.toml", "old").unwrap();
        first.finish().unwrap();
        assert!(matches!(OutputFolder::create(&path, false), Err(TumbleError::OutputExists { .. })));
        let second = OutputFolder::create(&path, true).unwrap();
        second.write("run.json", "{}").unwrap();
        assert!(path.join("body.toml").exists(), "the old result stays until the new one is complete");
        second.finish().unwrap();
        assert!(path.join("run.json").exists() && !path.join("body.toml").exists());
        assert_eq!(fs::read_dir(&base).unwrap().count(), 1);
    }

    #[test]
    fn what_took_the_name_meanwhile_stays_and_so_does_the_result() {
        let base = scratch("meanwhile");
        for force in [false, true] {
            let path = base.join(format!("run-{force}"));
            let folder = OutputFolder::create(&path, force).unwrap();
            fs::create_dir(&path).unwrap();
            fs::write(path.join("thesis.tex"), "years of work").unwrap();
            folder.write("run.json", "{}").unwrap();
            assert_eq!(folder.finish().unwrap(), base.join(format!("run-{force}-2")));
            assert_eq!(fs::read_to_string(path.join("thesis.tex")).unwrap(), "years of work");

            let path = base.join(format!("log-{force}.csv"));
            let mut file = OutputFile::create(&path, force).unwrap();
            file.write_all(b"new").unwrap();
            fs::write(&path, "old").unwrap();
            let place = file.finish().unwrap();
            assert_eq!(place, if force { path.clone() } else { base.join("log-false-2.csv") });
            assert_eq!(fs::read_to_string(&place).unwrap(), "new");
            assert_eq!(fs::read_to_string(&path).unwrap(), if force { "new" } else { "old" });
        }
    }

    #[test]
    fn force_never_replaces_what_is_not_a_result() {
        let base = scratch("not-a-result");
        let (file, notes, mixed) = (base.join("log.csv"), base.join("notes"), base.join("mixed"));
        fs::write(&file, "data").unwrap();
        fs::create_dir(&notes).unwrap();
        fs::write(notes.join("todo.txt"), "much").unwrap();
        fs::create_dir(&mixed).unwrap();
        fs::write(mixed.join("run.json"), "{}").unwrap();
        fs::write(mixed.join("thesis.tex"), "years of work").unwrap();
        for path in [&file, &notes, &mixed, &base.join("."), &base.join("notes/..")] {
            assert!(OutputFolder::create(path, true).is_err(), "{}", path.display());
        }
        assert!(fs::read_to_string(&file).unwrap() == "data" && mixed.join("thesis.tex").exists());
    }

    #[test]
    fn force_takes_an_empty_folder() {
        let base = scratch("empty");
        let path = base.join("run");
        fs::create_dir(&path).unwrap();
        assert!(matches!(OutputFolder::create(&path, false), Err(TumbleError::OutputExists { .. })));
        let folder = OutputFolder::create(&base.join("run/"), true).unwrap();
        folder.write("run.json", "{}").unwrap();
        assert_eq!(folder.finish().unwrap().as_os_str(), path.as_os_str());
        assert!(path.join("run.json").exists());
    }

    #[test]
    fn a_folder_below_a_file_cannot_be_written() {
        let base = scratch("below-file");
        fs::write(base.join("file"), "x").unwrap();
        assert!(matches!(
            OutputFolder::create(&base.join("file").join("run"), false),
            Err(TumbleError::File(FormatsError::Unwritable { .. }))
        ));
        assert!(matches!(
            write_file(&base.join("file").join("body.toml"), b"x", false),
            Err(TumbleError::File(FormatsError::Unwritable { .. }))
        ));
    }
}
