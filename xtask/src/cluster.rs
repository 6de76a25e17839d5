//! `cargo xtask cluster-test`: a campaign in sixteen parts, one of them killed and flown again, is the campaign flown at once.

use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::command::{Outcome, is_installed, programs_as_tested};

const PARTS: usize = 16;
/// The part that is killed.
const KILLED: usize = 5;
/// Seeds; with two weightings twice as many rows. Enough that a part is still at work when it is killed.
const MISSIONS: &str = "16000";
/// Seeds of the campaign that is flown; as many rows as parts.
const FLOWN_MISSIONS: &str = "8";
/// Trials to kill a part before it is through.
const TRIALS: usize = 20;
/// How long Slurm may take: a task that is started again waits two minutes.
const PATIENCE: Duration = Duration::from_secs(420);

pub fn main(arguments: &[String]) -> ExitCode {
    if !arguments.is_empty() {
        eprintln!("cluster-test takes no argument");
        return ExitCode::from(2);
    }
    match step() {
        Outcome::Ok => ExitCode::SUCCESS,
        Outcome::Skipped(reason) => {
            eprintln!("skipped: {reason}");
            ExitCode::SUCCESS
        }
        Outcome::Failed(reason) => {
            eprintln!("FAILED: {reason}");
            ExitCode::FAILURE
        }
    }
}

/// Child processes always; Slurm where it is installed.
pub fn step() -> Outcome {
    let program = match programs_as_tested() {
        Ok(folder) => folder.join("tumble"),
        Err(reason) => return Outcome::Failed(reason),
    };
    let folder = std::env::temp_dir().join(format!("tumble-cluster-{}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    let outcome = fs::create_dir_all(&folder).map_err(|error| error.to_string()).and_then(|()| run(&program, &folder));
    match outcome {
        Ok(()) => {
            let _ = fs::remove_dir_all(&folder);
            Outcome::Ok
        }
        Err(reason) => Outcome::Failed(format!("{reason}; what it wrote is in {}", folder.display())),
    }
}

fn run(program: &Path, folder: &Path) -> Result<(), String> {
    let started = Instant::now();
    finished(&mut campaign(program, folder, &["--out", "alone", "--shard", "0/1"]), "the campaign in one part")?;
    finished(&mut campaign(program, folder, &["--out", "whole"]), "the whole campaign")?;
    child_processes(program, folder)?;
    compare(program, folder, "parts")?;
    println!(
        "{PARTS} child processes, one killed and started again: same bytes ({:.1} s)",
        started.elapsed().as_secs_f64()
    );
    let started = Instant::now();
    flown(program, folder)?;
    println!("{PARTS} child processes that fly: same bytes ({:.1} s)", started.elapsed().as_secs_f64());
    if !is_installed("slurmctld", "-V") {
        println!("skipped: Slurm (`slurmctld` is not installed); only child processes were tested");
        return Ok(());
    }
    let started = Instant::now();
    slurm(program, folder)?;
    compare(program, folder, "slurm-parts")?;
    println!("{PARTS} Slurm tasks, one started again: same bytes ({:.1} s)", started.elapsed().as_secs_f64());
    Ok(())
}

/// `tumble campaign` of the test with more arguments.
fn campaign(program: &Path, folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(program);
    command.args([
        "campaign",
        "iss-slalom",
        "--dry-run",
        "--missions",
        MISSIONS,
        "--weighting",
        "covariance,none",
        "--draw",
    ]);
    command.args(arguments).current_dir(folder).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

fn finished(command: &mut Command, what: &str) -> Result<(), String> {
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("{what}: {status}")),
        Err(error) => Err(format!("{what}: {error}")),
    }
}

fn part(program: &Path, folder: &Path, index: usize) -> Command {
    campaign(program, folder, &["--out", "parts", "--jobs", "1", "--shard", &format!("{index}/{PARTS}")])
}

/// All parts at once; one is killed while it writes, and started again.
fn child_processes(program: &Path, folder: &Path) -> Result<(), String> {
    let mut killed = false;
    for _ in 0..TRIALS {
        let mut child = part(program, folder, KILLED).spawn().map_err(|error| error.to_string())?;
        if kill_while_writing(&mut child, folder).map_err(|error| error.to_string())? {
            killed = true;
            break;
        }
        // It was through before; again from nothing.
        fs::remove_dir_all(folder.join("parts")).map_err(|error| error.to_string())?;
    }
    if !killed {
        return Err(format!("in {TRIALS} trials no part was killed while it wrote"));
    }
    let children: Vec<(usize, io::Result<Child>)> =
        (0..PARTS).map(|index| (index, part(program, folder, index).spawn())).collect();
    for (index, child) in children {
        let status = child.and_then(|mut child| child.wait()).map_err(|error| format!("part {index}: {error}"))?;
        if !status.success() {
            return Err(format!("part {index}: {status}"));
        }
    }
    Ok(())
}

/// Kills a part (signal 9) once rows are on file, and tears the last one; whether it was still at work.
fn kill_while_writing(child: &mut Child, folder: &Path) -> io::Result<bool> {
    let unfinished = folder.join(format!("parts/part-{KILLED}-of-{PARTS}.unfinished/journal.csv"));
    let size = || fs::metadata(&unfinished).map_or(0, |data| data.len());
    while size() < 20_000 && child.try_wait()?.is_none() {
        std::hint::spin_loop();
    }
    child.kill()?;
    child.wait()?;
    if !unfinished.exists() || folder.join(format!("parts/part-{KILLED}-of-{PARTS}")).exists() {
        return Ok(false);
    }
    // A kill seldom falls into the one call that writes a row; a lost power supply would.
    let torn = size().saturating_sub(7);
    fs::OpenOptions::new().write(true).open(&unfinished)?.set_len(torn)?;
    let rows = fs::read_to_string(&unfinished)?.lines().count();
    println!("part {KILLED} killed after {rows} rows, the last one torn");
    Ok(rows > 2)
}

/// Missions that are flown, of which the beginning is enough: in parts, one of them ended in the middle, they are what they are at once.
fn flown(program: &Path, folder: &Path) -> Result<(), String> {
    let scenario = text_of(Command::new(program).args(["scenario", "show", "granite-cargo"]))?;
    let short = scenario.replacen("duration_s = 150.0", "duration_s = 20.0", 1);
    if short == scenario {
        return Err("granite-cargo does not last 150 s any more".into());
    }
    fs::write(folder.join("short.toml"), short).map_err(|error| error.to_string())?;
    let campaign = |out: &str, arguments: &[&str]| {
        let mut command = Command::new(program);
        command.args([
            "campaign",
            "short.toml",
            "--missions",
            FLOWN_MISSIONS,
            "--weighting",
            "covariance,none",
            "--draw",
        ]);
        command.args(["--out", out]).args(arguments).current_dir(folder).stdout(Stdio::null()).stderr(Stdio::null());
        command
    };
    let part = |index: usize| campaign("flown-parts", &["--jobs", "1", "--shard", &format!("{index}/{PARTS}")]);
    not_arrived(campaign("flown-whole", &[]).status(), "the campaign that flies")?;
    let mut killed = part(KILLED).spawn().map_err(|error| error.to_string())?;
    sleep(Duration::from_millis(100));
    killed.kill().and_then(|()| killed.wait()).map_err(|error| error.to_string())?;
    let children: Vec<(usize, io::Result<Child>)> = (0..PARTS).map(|index| (index, part(index).spawn())).collect();
    for (index, child) in children {
        not_arrived(child.and_then(|mut child| child.wait()), &format!("part {index} that flies"))?;
    }
    merge_and_compare(program, folder, "flown-parts", &["flown-whole"])
}

/// Nothing arrives within 20 s, which the exit code 3 says.
fn not_arrived(status: io::Result<ExitStatus>, what: &str) -> Result<(), String> {
    match status {
        Ok(status) if status.code() == Some(3) => Ok(()),
        Ok(status) => Err(format!("{what}: {status}")),
        Err(error) => Err(format!("{what}: {error}")),
    }
}

/// That the merged parts are what was planned at once.
fn compare(program: &Path, folder: &Path, parts: &str) -> Result<(), String> {
    merge_and_compare(program, folder, parts, &["whole", "alone/part-0-of-1"])
}

/// That the merged parts have the table of each of these places, and all else of the first.
fn merge_and_compare(program: &Path, folder: &Path, parts: &str, places: &[&str]) -> Result<(), String> {
    let merged = format!("{parts}-merged");
    let mut merge = Command::new(program);
    merge.args(["campaign", "merge", parts, "--out", &merged]).current_dir(folder);
    let merge =
        merge.stdout(Stdio::null()).stderr(Stdio::null()).status().map_err(|error| format!("merge: {error}"))?;
    // 3 says that not every mission arrived
    if !matches!(merge.code(), Some(0 | 3)) {
        return Err(format!("merge: {merge}"));
    }
    let read = |place: &str, name: &str| {
        let path = folder.join(place).join(name);
        fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))
    };
    let table = read(&merged, "rows.csv")?;
    for place in places {
        if read(place, "rows.csv")? != table {
            return Err(format!("rows.csv of {parts}, merged, is not that of {place}"));
        }
    }
    for name in ["summary.json", "run.json"] {
        if places.first().is_some_and(|whole| read(whole, name) != read(&merged, name)) {
            return Err(format!("{name} of {parts}, merged, is not that of the whole campaign"));
        }
    }
    Ok(())
}

/// A daemon that ends with the test.
struct Daemon(Child);

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// One controller and one node on this machine, and the parts as a job array.
fn slurm(program: &Path, folder: &Path) -> Result<(), String> {
    let here = folder.join("slurm");
    for name in ["state", "spool"] {
        fs::create_dir_all(here.join(name)).map_err(|error| error.to_string())?;
    }
    let host = text_of(Command::new("hostname").arg("-s"))?;
    let user = text_of(Command::new("id").arg("-un"))?;
    let configuration = here.join("slurm.conf");
    fs::write(&configuration, slurm_conf(&here, host.trim(), user.trim())).map_err(|error| error.to_string())?;
    let script = here.join("parts.sh");
    fs::write(&script, slurm_script(program, folder)).map_err(|error| error.to_string())?;
    let with = |name: &str, arguments: &[&OsStr]| {
        let mut command = Command::new(name);
        command.env("SLURM_CONF", &configuration).args(arguments).current_dir(folder);
        command
    };
    let daemon = |name: &str| {
        let log = fs::File::create(here.join(format!("{name}.log"))).map_err(|error| error.to_string())?;
        let errors = log.try_clone().map_err(|error| error.to_string())?;
        let child = with(name, &["-D".as_ref()]).stdout(log).stderr(errors).spawn();
        child.map(Daemon).map_err(|error| format!("{name}: {error}"))
    };
    let _controller = daemon("slurmctld")?;
    sleep(Duration::from_secs(2));
    let _node = daemon("slurmd")?;
    let begun = Instant::now();
    while !text_of(&mut with("sinfo", &["-h".as_ref(), "-o".as_ref(), "%t".as_ref()]))
        .is_ok_and(|state| state.contains("idle"))
    {
        if begun.elapsed() > Duration::from_secs(60) {
            return Err("Slurm's node does not become idle".into());
        }
        sleep(Duration::from_secs(1));
    }
    let array = format!("--array=0-{}", PARTS - 1);
    let submitted = text_of(&mut with("sbatch", &["--parsable".as_ref(), array.as_ref(), script.as_ref()]))?;
    let job = submitted.trim().to_owned();
    let task = format!("{job}_{KILLED}");
    // the task holds itself until it is told to go on, so that it is requeued at work
    let begun = Instant::now();
    while !here.join("waiting").exists() && begun.elapsed() < PATIENCE {
        sleep(Duration::from_millis(200));
    }
    finished(&mut with("scontrol", &["requeue".as_ref(), task.as_ref()]), "scontrol requeue")?;
    while !text_of(&mut with("squeue", &["-h".as_ref(), "-j".as_ref(), job.as_ref()]))
        .unwrap_or_default()
        .trim()
        .is_empty()
    {
        if begun.elapsed() > PATIENCE {
            return Err("Slurm's job array does not end".into());
        }
        sleep(Duration::from_secs(2));
    }
    Ok(())
}

fn slurm_conf(here: &Path, host: &str, user: &str) -> String {
    let here = here.display();
    format!(
        "ClusterName=tumble\nSlurmctldHost={host}\nAuthType=auth/none\nCredType=cred/none\nSlurmUser={user}\n\
         SlurmdUser={user}\nStateSaveLocation={here}/state\nSlurmdSpoolDir={here}/spool\nSlurmctldPidFile={here}/slurmctld.pid\n\
         SlurmdPidFile={here}/slurmd.pid\nProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\nSwitchType=switch/none\n\
         SelectType=select/cons_tres\nReturnToService=2\nSlurmctldPort=16817\nSlurmdPort=16818\nMpiDefault=none\n\
         NodeName={host} CPUs=2 State=UNKNOWN\nPartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP\n"
    )
}

/// One task; the one that is to be requeued waits for it at its first start.
fn slurm_script(program: &Path, folder: &Path) -> String {
    let (program, folder) = (program.display(), folder.display());
    format!(
        "#!/bin/sh\n#SBATCH --requeue\n#SBATCH --output={folder}/slurm/task-%a.log\ncd '{folder}'\n\
         if [ \"$SLURM_ARRAY_TASK_ID\" = {KILLED} ] && [ ! -e slurm/waiting ]; then touch slurm/waiting; sleep 600; fi\n\
         '{program}' campaign iss-slalom --dry-run --missions {MISSIONS} --weighting covariance,none --draw --jobs 1 \
         --out slurm-parts --shard \"$SLURM_ARRAY_TASK_ID/{PARTS}\"\n"
    )
}

fn text_of(command: &mut Command) -> Result<String, String> {
    let name = PathBuf::from(command.get_program()).display().to_string();
    let output = command.stdin(Stdio::null()).output().map_err(|error| format!("{name}: {error}"))?;
    if !output.status.success() {
        return Err(format!("{name}: {}", String::from_utf8_lossy(&output.stderr).trim()));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
