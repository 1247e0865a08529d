//! Chromium, held by its DevTools protocol: JSON, ended by zeros, on two pipes.
//!
//! A page is looked at for as long as it takes: nothing here depends on when the browser says that it is loaded.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// What takes longer than this does not happen; a busy machine may start a browser for half a minute.
const PATIENCE: Duration = Duration::from_secs(120);
/// Time between two looks at a page.
const PAUSE: Duration = Duration::from_millis(100);
/// The browser reads from descriptor 3 and writes to 4.
const ON_PIPES: &str = "exec \"$@\" --remote-debugging-pipe 3<&0 4>&1 </dev/null >/dev/null";

/// A browser with one page, until it is dropped.
pub struct Browser {
    child: Child,
    commands: ChildStdin,
    messages: Receiver<Value>,
    session: Option<String>,
    count: u64,
    /// What went wrong on the page: exceptions, and errors and warnings on its console.
    pub problems: Vec<String>,
}

impl Browser {
    /// Opens a page, with a profile in a folder.
    pub fn open(options: &[&str], folder: &Path, address: &str) -> Self {
        let mut command = Command::new("sh");
        command.args(["-c", ON_PIPES, "sh", "chromium"]).args(options);
        command.arg(format!("--user-data-dir={}", folder.join("browser").display()));
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let commands = child.stdin.take().unwrap();
        let output = BufReader::new(child.stdout.take().unwrap());
        let (sender, messages) = channel();
        std::thread::spawn(move || {
            let texts = output.split(0).map_while(Result::ok);
            texts.map(|text| serde_json::from_slice(&text).unwrap()).try_for_each(|message| sender.send(message))
        });
        let mut browser = Self { child, commands, messages, session: None, count: 0, problems: Vec::new() };
        let target = browser.ask("Target.createTarget", &json!({"url": "about:blank"}));
        let flat = json!({"targetId": target["result"]["targetId"], "flatten": true});
        let session = browser.ask("Target.attachToTarget", &flat);
        browser.session = Some(session["result"]["sessionId"].as_str().expect("a page").to_owned());
        for domain in ["Runtime.enable", "Log.enable"] {
            browser.ask(domain, &json!({}));
        }
        browser.ask("Page.navigate", &json!({"url": address}));
        browser
    }

    /// Looks at the page until an expression is true, or has a value that counts as such; the value.
    pub fn until(&mut self, expression: &str) -> Value {
        let begin = Instant::now();
        loop {
            let answer = self.ask("Runtime.evaluate", &json!({"expression": expression, "returnByValue": true}));
            // Before its scripts have run a page knows none of their names: that is an exception.
            let found = &answer["result"];
            let value = &found["result"]["value"];
            if found["exceptionDetails"].is_null() && !matches!(value, Value::Null | Value::Bool(false)) {
                return value.clone();
            }
            assert!(begin.elapsed() < PATIENCE, "never true: {expression}; {answer}; {:#?}", self.problems);
            std::thread::sleep(PAUSE);
        }
    }

    /// Sends a command and waits for its answer, taking note of problems in between.
    fn ask(&mut self, method: &str, parameters: &Value) -> Value {
        self.count += 1;
        let mut command = json!({"id": self.count, "method": method, "params": parameters});
        if let Some(session) = &self.session {
            command["sessionId"] = json!(session);
        }
        write!(self.commands, "{command}\0").expect("chromium runs: apt-get install chromium");
        loop {
            let message = self.messages.recv_timeout(PATIENCE).expect("chromium answers: apt-get install chromium");
            if message["id"] == self.count {
                return message;
            }
            self.note(&message);
        }
    }

    fn note(&mut self, message: &Value) {
        let params = &message["params"];
        let is_bad = match message["method"].as_str() {
            Some("Runtime.exceptionThrown") => true,
            Some("Runtime.consoleAPICalled") => {
                matches!(params["type"].as_str(), Some("error" | "warning" | "assert"))
            }
            Some("Log.entryAdded") => params["entry"]["level"] == "error",
            _ => false,
        };
        if is_bad {
            self.problems.push(params.to_string());
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
