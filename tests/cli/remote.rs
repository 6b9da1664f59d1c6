//! A page in a headless Chromium that is told what to do through two pipes, without a network port.
//!
//! # Source
//! Chrome DevTools Protocol; messages are JSON, each ended by a zero byte, on the descriptors 3 and 4.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Instant;

use serde_json::{Value, json};

use super::explorer::PATIENCE;

pub struct Page {
    browser: Child,
    to: File,
    from: Receiver<Value>,
    session: Option<String>,
    last_id: u64,
    complaints: Vec<String>,
}

impl Page {
    /// Opens a file; what the page saves goes into a folder.
    pub fn open(browser: &str, profile: &Path, file: &Path, downloads: &Path) -> Self {
        let [input, output] = ["to-browser", "from-browser"].map(|name| profile.join(name));
        let made = Command::new("mkfifo").args([&input, &output]).status().expect("a pipe can be made");
        assert!(made.success());
        let script = "in=$1 out=$2; shift 2; exec \"$@\" 3<\"$in\" 4>\"$out\"";
        let child = Command::new("sh")
            .args(["-c", script, "sh"])
            .args([&input, &output])
            .args([browser, "--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe", "--no-first-run"])
            .args(["--host-resolver-rules=MAP * ~NOTFOUND", "--window-size=1280,1600"])
            .arg(format!("--user-data-dir={}", profile.join("browser").display()))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the browser starts");
        let to = OpenOptions::new().write(true).open(&input).unwrap();
        let mut reader = BufReader::new(File::open(&output).unwrap());
        let (sender, from) = channel();
        std::thread::spawn(move || {
            let mut message = Vec::new();
            while reader.read_until(0, &mut message).is_ok_and(|read| read > 0) {
                message.pop();
                if sender.send(serde_json::from_slice(&message).unwrap_or(Value::Null)).is_err() {
                    return;
                }
                message.clear();
            }
        });
        let mut page = Self { browser: child, to, from, session: None, last_id: 0, complaints: Vec::new() };
        let folder = downloads.display().to_string();
        page.call("Browser.setDownloadBehavior", json!({ "behavior": "allow", "downloadPath": folder }));
        let target = page.call("Target.createTarget", json!({ "url": "about:blank" }))["targetId"].clone();
        let attached = page.call("Target.attachToTarget", json!({ "targetId": target, "flatten": true }));
        page.session = attached["sessionId"].as_str().map(str::to_owned);
        page.call("Runtime.enable", json!({}));
        page.call("Log.enable", json!({}));
        page.call("Page.enable", json!({}));
        page.go(file);
        page
    }

    /// Opens another file in the same place.
    pub fn go(&mut self, file: &Path) {
        self.call("Page.navigate", json!({ "url": format!("file://{}", file.display()) }));
        self.until("document.readyState === 'complete'");
    }

    /// Makes the window so wide.
    pub fn resize(&mut self, width: u32) {
        let size = json!({ "width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600 });
        self.call("Emulation.setDeviceMetricsOverride", size);
    }

    /// Shows the page as on a `screen` or in `print`, to a reader who prefers `light` or `dark`.
    pub fn look_as(&mut self, medium: &str, scheme: &str) {
        let features = json!([{ "name": "prefers-color-scheme", "value": scheme }]);
        self.call("Emulation.setEmulatedMedia", json!({ "media": medium, "features": features }));
    }

    /// Calls a method; its result.
    pub fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.last_id += 1;
        let mut message = json!({ "id": self.last_id, "method": method, "params": parameters });
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        self.to.write_all(message.to_string().as_bytes()).and_then(|()| self.to.write_all(&[0])).unwrap();
        loop {
            let answer = self.from.recv_timeout(PATIENCE).unwrap_or_else(|e| panic!("{method}: {e}"));
            self.hear(&answer);
            if answer["id"] == json!(self.last_id) {
                assert!(answer.get("error").is_none(), "{method}: {answer}");
                return answer["result"].clone();
            }
        }
    }

    fn hear(&mut self, event: &Value) {
        let parameters = &event["params"];
        match event["method"].as_str() {
            Some("Runtime.exceptionThrown") => self.complaints.push(parameters["exceptionDetails"].to_string()),
            Some("Log.entryAdded") => self.complaints.push(parameters["entry"]["text"].to_string()),
            Some("Runtime.consoleAPICalled") => self.complaints.push(parameters["args"].to_string()),
            _ => {}
        }
    }

    /// Exceptions, refused scripts and whatever else the console shows.
    pub fn complaints(&self) -> Vec<String> {
        self.complaints.clone()
    }

    /// The value of an expression in the page.
    pub fn value(&mut self, expression: &str) -> Value {
        let asked = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let answer = self.call("Runtime.evaluate", asked);
        assert!(answer.get("exceptionDetails").is_none(), "{expression}: {answer}");
        answer["result"].get("value").cloned().unwrap_or(Value::Null)
    }

    /// Waits until a condition holds in the page.
    pub fn until(&mut self, condition: &str) {
        let started = Instant::now();
        while self.value(condition) != json!(true) {
            let seen = "document.getElementById('fault')?.textContent + ' | ' + document.body.dataset.shown";
            assert!(started.elapsed() < PATIENCE, "{condition}: {} {:?}", self.value(seen), self.complaints);
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    }

    /// Drags one element onto another with the mouse.
    pub fn drag(&mut self, from: &str, to: &str) {
        let middle = |page: &mut Self, selector: &str| {
            let of = format!(
                "(() => {{ const r = document.querySelector(\"{selector}\").getBoundingClientRect(); \
                 return [r.left + r.width / 2, r.top + r.height / 2]; }})()"
            );
            page.value(&of)
        };
        self.value(&format!("document.querySelector(\"{from}\").scrollIntoView({{ block: 'center' }})"));
        let (start, end) = (middle(self, from), middle(self, to));
        for (kind, at) in [("mousePressed", &start), ("mouseMoved", &end), ("mouseReleased", &end)] {
            let event =
                json!({ "type": kind, "x": at[0], "y": at[1], "button": "left", "buttons": 1, "clickCount": 1 });
            self.call("Input.dispatchMouseEvent", event);
        }
    }

    pub fn wait_for(&mut self, file: &Path) {
        let started = Instant::now();
        while !file.is_file() {
            assert!(started.elapsed() < PATIENCE, "{} did not come", file.display());
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    }

    pub fn close(mut self) {
        self.session = None;
        self.call("Browser.close", json!({}));
        let _ = self.browser.wait();
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        let _ = self.browser.kill();
        let _ = self.browser.wait();
    }
}
