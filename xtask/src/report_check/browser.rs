//! A headless Chromium, spoken to through its DevTools.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::web_socket::WebSocket;

const NAMES: [&str; 6] =
    ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "headless_shell", "chrome"];

/// The browser that `TUMBLE_BROWSER` names, or one on the search path.
pub fn find() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os("TUMBLE_BROWSER").filter(|name| !name.is_empty()) {
        let path = PathBuf::from(named);
        return path.is_file().then_some(path);
    }
    let folders: Vec<PathBuf> = std::env::split_paths(&std::env::var_os("PATH")?).collect();
    NAMES.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name))).find(|path| path.is_file())
}

/// A running browser; it ends, and what it wrote goes, when it is dropped.
pub struct Browser {
    child: Child,
    profile: PathBuf,
    port: u16,
}

impl Browser {
    pub fn start(program: &Path) -> Result<Self, String> {
        let profile = std::env::temp_dir().join(format!("tumble-report-check-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&profile);
        std::fs::create_dir_all(&profile).map_err(|error| error.to_string())?;
        let mut command = Command::new(program);
        command.args([
            "--headless",
            "--disable-gpu",
            "--no-first-run",
            "--no-default-browser-check",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--disable-extensions",
            "--disable-dev-shm-usage",
            "--hide-scrollbars",
            "--remote-debugging-port=0",
            // Containers run as root, where the sandbox cannot be set up; the page is our own.
            "--no-sandbox",
        ]);
        command.arg(format!("--user-data-dir={}", profile.display())).arg("about:blank");
        let child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn();
        let child = child.map_err(|error| format!("{}: {error}", program.display()))?;
        let mut browser = Self { child, profile, port: 0 };
        let started = Instant::now();
        while browser.port == 0 {
            if started.elapsed() > Duration::from_secs(60) {
                return Err(format!("{} does not open its DevTools", program.display()));
            }
            if let Ok(Some(status)) = browser.child.try_wait() {
                return Err(format!("{} ended at once ({status})", program.display()));
            }
            std::thread::sleep(Duration::from_millis(50));
            let text = std::fs::read_to_string(browser.profile.join("DevToolsActivePort")).unwrap_or_default();
            browser.port = text.lines().next().and_then(|line| line.parse().ok()).unwrap_or(0);
        }
        Ok(browser)
    }

    /// A new page.
    pub fn page(&self) -> Result<Page, String> {
        let answer = self.ask("PUT", "/json/new?about:blank").map_err(|error| error.to_string())?;
        let address = text_after(&answer, "\"webSocketDebuggerUrl\":").ok_or(answer.clone())?;
        let path = address.find("/devtools/").and_then(|start| address.get(start..)).ok_or(answer)?;
        let socket = WebSocket::open(self.port, path).map_err(|error| error.to_string())?;
        Ok(Page { socket, number: 0, events: Vec::new() })
    }

    fn ask(&self, method: &str, path: &str) -> std::io::Result<String> {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port))?;
        stream.set_read_timeout(Some(Duration::from_secs(20)))?;
        write!(stream, "{method} {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")?;
        let mut answer = Vec::new();
        let mut piece = [0; 4096];
        // The connection may stay open: the object ends with its brace.
        while !String::from_utf8_lossy(&answer).trim_end().ends_with('}') {
            let count = stream.read(&mut piece)?;
            if count == 0 {
                break;
            }
            answer.extend(piece.iter().take(count));
        }
        Ok(String::from_utf8_lossy(&answer).into_owned())
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        // Its helpers may still be writing for a moment.
        for _ in 0..20 {
            if std::fs::remove_dir_all(&self.profile).is_ok() || !self.profile.exists() {
                break;
            }
            std::thread::sleep(Duration::from_millis(100));
        }
    }
}

/// A page of it.
pub struct Page {
    socket: WebSocket,
    number: u64,
    events: Vec<String>,
}

impl Page {
    /// Sends a command and waits for its answer; what happens meanwhile is kept.
    fn command(&mut self, method: &str, parameters: &str) -> Result<String, String> {
        self.number += 1;
        let number = self.number;
        let sent = self.socket.send(&format!("{{\"id\":{number},\"method\":\"{method}\",\"params\":{parameters}}}"));
        sent.map_err(|error| format!("{method}: {error}"))?;
        loop {
            let message = self.socket.receive().map_err(|error| format!("{method}: {error}"))?;
            if message.starts_with(&format!("{{\"id\":{number},")) {
                if message.starts_with(&format!("{{\"id\":{number},\"error\"")) {
                    return Err(format!("{method}: {message}"));
                }
                return Ok(message);
            }
            self.events.push(message);
        }
    }

    /// A window of this size and these wishes, cut off from every network.
    pub fn prepare(&mut self, width: u32, height: u32, scheme: &str, motion: &str) -> Result<(), String> {
        for domain in ["Page", "Runtime", "Log", "Network"] {
            self.command(&format!("{domain}.enable"), "{}")?;
        }
        let offline = r#"{"offline":true,"latency":0,"downloadThroughput":0,"uploadThroughput":0}"#;
        self.command("Network.emulateNetworkConditions", offline)?;
        let is_phone = width < 600;
        let metrics = format!(r#"{{"width":{width},"height":{height},"deviceScaleFactor":1,"mobile":{is_phone}}}"#);
        self.command("Emulation.setDeviceMetricsOverride", &metrics)?;
        let media = format!(
            r#"{{"features":[{{"name":"prefers-color-scheme","value":"{scheme}"}},{{"name":"prefers-reduced-motion","value":"{motion}"}}]}}"#
        );
        self.command("Emulation.setEmulatedMedia", &media).map(drop)
    }

    pub fn open(&mut self, address: &str) -> Result<(), String> {
        let answer = self.command("Page.navigate", &format!("{{\"url\":{}}}", quoted(address)))?;
        if answer.contains("\"errorText\"") { Err(format!("{address}: {answer}")) } else { Ok(()) }
    }

    /// The text that an expression gives.
    pub fn evaluate(&mut self, expression: &str) -> Result<String, String> {
        let parameters = format!("{{\"expression\":{},\"returnByValue\":true}}", quoted(expression));
        let answer = self.command("Runtime.evaluate", &parameters)?;
        if answer.contains("\"exceptionDetails\"") {
            return Err(format!("{expression}: {answer}"));
        }
        Ok(text_after(&answer, "\"value\":").unwrap_or_default())
    }

    /// What the window shows, as base64 of a PNG, once what is due has been drawn.
    pub fn picture(&mut self) -> Result<String, String> {
        self.capture("{\"format\":\"png\"}")
    }

    fn capture(&mut self, parameters: &str) -> Result<String, String> {
        let drawn = r#"{"expression":"new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))","awaitPromise":true}"#;
        self.command("Runtime.evaluate", drawn)?;
        let answer = self.command("Page.captureScreenshot", parameters)?;
        text_after(&answer, "\"data\":").ok_or_else(|| "no picture".into())
    }

    /// The whole page as a file.
    pub fn screenshot(&mut self, path: &Path) -> Result<(), String> {
        let height = self.evaluate("String(document.documentElement.scrollHeight)")?;
        let width = self.evaluate("String(document.documentElement.clientWidth)")?;
        let clip = format!("{{\"x\":0,\"y\":0,\"width\":{width},\"height\":{height},\"scale\":1}}");
        let data = self.capture(&format!("{{\"format\":\"png\",\"captureBeyondViewport\":true,\"clip\":{clip}}}"))?;
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|error| error.to_string())?;
        }
        std::fs::write(path, from_base64(&data)).map_err(|error| format!("{}: {error}", path.display()))
    }

    /// Errors of the console, and everything that was asked of a network.
    pub fn troubles(&self) -> Vec<String> {
        self.events.iter().filter_map(|event| trouble(event)).collect()
    }
}

/// What is wrong about an event, if anything is.
fn trouble(event: &str) -> Option<String> {
    let is = |method: &str| event.starts_with(&format!("{{\"method\":\"{method}\""));
    let short: String = event.chars().take(400).collect();
    let is_error = is("Runtime.exceptionThrown")
        || is("Runtime.consoleAPICalled") && event.contains("\"type\":\"error\"")
        || is("Log.entryAdded") && event.contains("\"level\":\"error\"")
        || is("Inspector.targetCrashed");
    if is_error {
        return Some(format!("on the console: {short}"));
    }
    let asks = is("Network.requestWillBeSent") || is("Network.webSocketCreated");
    // The request's own address, after that of the document.
    let address = text_after(event.get(event.find("\"request\":")?..)?, "\"url\":")?;
    (asks && !address.starts_with("file://") && !address.starts_with("about:")).then(|| format!("asked for {address}"))
}

/// The text that follows a key in JSON.
fn text_after(json: &str, key: &str) -> Option<String> {
    let start = json.find(key)? + key.len();
    let mut characters = json.get(start..)?.trim_start().strip_prefix('"')?.chars();
    let mut text = String::new();
    loop {
        match characters.next()? {
            '"' => return Some(text),
            '\\' => match characters.next()? {
                'n' => text.push('\n'),
                't' => text.push('\t'),
                'u' => {
                    let code: String = characters.by_ref().take(4).collect();
                    text.push(u32::from_str_radix(&code, 16).ok().and_then(char::from_u32).unwrap_or('\u{fffd}'));
                }
                other => text.push(other),
            },
            other => text.push(other),
        }
    }
}

/// A text in JSON.
fn quoted(text: &str) -> String {
    let mut json = String::from("\"");
    for character in text.chars() {
        match character {
            '"' | '\\' => json.extend(['\\', character]),
            '\n' => json.push_str("\\n"),
            other => json.push(other),
        }
    }
    json + "\""
}

fn from_base64(text: &str) -> Vec<u8> {
    let (mut bytes, mut bits, mut count) = (Vec::with_capacity(text.len() / 4 * 3), 0_u32, 0);
    for byte in text.bytes() {
        let value = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => continue,
        };
        bits = bits << 6 | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.extend((bits >> count).to_be_bytes().last());
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_read_as_they_were_written() {
        let text = "a \"b\" \\ c\nd";
        assert_eq!(text_after(&format!("{{\"value\": {}}}", quoted(text)), "\"value\":").unwrap(), text);
        assert_eq!(text_after(r#"{"value":"\u00e9"}"#, "\"value\":").unwrap(), "é");
        assert_eq!(text_after(r#"{"value":"no end"#, "\"value\":"), None);
        assert_eq!(from_base64("aGVsbG8="), b"hello");
    }

    #[test]
    fn troubles_are_told_from_the_rest() {
        let bad = [
            r#"{"method":"Runtime.exceptionThrown","params":{}}"#,
            r#"{"method":"Runtime.consoleAPICalled","params":{"type":"error"}}"#,
            r#"{"method":"Log.entryAdded","params":{"entry":{"level":"error"}}}"#,
            r#"{"method":"Network.requestWillBeSent","params":{"documentURL":"file:///a","request":{"url":"https://b"}}}"#,
        ];
        let good = [
            r#"{"method":"Runtime.consoleAPICalled","params":{"type":"info"}}"#,
            r#"{"method":"Network.requestWillBeSent","params":{"request":{"url":"file:///a"}}}"#,
            r#"{"method":"Network.loadingFinished","params":{}}"#,
        ];
        assert!(bad.iter().all(|event| trouble(event).is_some()));
        assert!(good.iter().all(|event| trouble(event).is_none()));
    }
}
