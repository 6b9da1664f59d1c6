//! Runs a use case beside the interpreter: its lock is released, signals are seen, progress and notes come back to the caller.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use coilwright::task::{Observer, TaskError};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::error::{raised, wrong};

/// Signals are looked for this often.
const LOOK: Duration = Duration::from_millis(50);
/// Work that is told to stop is waited for this long; what does not look at the flag ends by itself, unseen.
const PATIENCE: Duration = Duration::from_secs(5);

enum Message<T> {
    Note(String),
    At(f64, String),
    Done(Result<T, Failure>),
}

/// Why there is no answer.
pub enum Failure {
    Task(TaskError),
    Stopped,
    Panic(String),
}

impl<E: Into<TaskError>> From<E> for Failure {
    fn from(error: E) -> Self {
        Failure::Task(error.into())
    }
}

/// What is unwound with where work has no other way to be told that it should stop.
struct Stop;

/// Watches a use case on its thread.
pub struct Watcher {
    stop: Arc<AtomicBool>,
    until: Option<Instant>,
    send: Box<dyn Fn(Said) + Send + Sync>,
    last: Mutex<Instant>,
}

enum Said {
    Note(String),
    At(f64, String),
}

impl Watcher {
    /// Whether the caller wants it to stop, whatever the clock says.
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    pub fn is_over(&self) -> bool {
        self.until.is_some_and(|until| Instant::now() >= until)
    }

    /// From now on, for so long.
    pub fn within(mut self, budget: Option<Duration>) -> Self {
        self.until = budget.and_then(|budget| Instant::now().checked_add(budget));
        self
    }
}

impl Observer for Watcher {
    fn note(&self, words: &str) {
        (self.send)(Said::Note(words.to_owned()));
    }

    fn at(&self, share_done: f64, words: &str) {
        if self.is_stopped() {
            // A diagnosis is told so by nothing else.
            resume_unwind(Box::new(Stop));
        }
        let Ok(mut last) = self.last.try_lock() else { return };
        if last.elapsed() >= LOOK {
            *last = Instant::now();
            (self.send)(Said::At(share_done, words.to_owned()));
        }
    }

    fn goes_on(&self) -> bool {
        !self.is_stopped() && !self.is_over()
    }
}

/// An answer, and what was said on the way.
pub struct Worked<T> {
    pub answer: T,
    pub notes: Vec<String>,
}

/// Carries out work on a thread of its own while this one waits for signals without the interpreter's lock. `progress` is called,
/// on the caller's thread, with the share that is done and where the work stands.
pub fn work<T: Send + 'static>(
    py: Python,
    progress: Option<&Bound<PyAny>>,
    job: impl FnOnce(Watcher) -> Result<T, Failure> + Send + 'static,
) -> PyResult<Worked<T>> {
    let (sender, receiver) = channel::<Message<T>>();
    let stop = Arc::new(AtomicBool::new(false));
    let watcher = watcher(sender.clone(), Arc::clone(&stop));
    std::thread::spawn(move || {
        let found = catch_unwind(AssertUnwindSafe(|| job(watcher)));
        let done = found.unwrap_or_else(|payload| Err(failure(payload.as_ref())));
        // A caller that has given up hears nothing.
        let _ = sender.send(Message::Done(done));
    });
    let receiver = Mutex::new(receiver);
    let mut notes = Vec::new();
    loop {
        let message = py.detach(|| receive(&receiver, LOOK));
        let seen = match message {
            Ok(Message::Done(done)) => return finished(py, done, notes),
            Ok(Message::Note(words)) => {
                notes.push(words);
                Ok(())
            }
            Ok(Message::At(share, words)) => progress.map_or(Ok(()), |call| call.call1((share, words)).map(|_| ())),
            Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => return Err(broken("the work ended without an answer")),
        };
        if let Err(error) = seen.and_then(|()| py.check_signals()) {
            stop.store(true, Ordering::Relaxed);
            py.detach(|| wait(&receiver));
            return Err(error);
        }
    }
}

fn watcher<T: Send + 'static>(sender: Sender<Message<T>>, stop: Arc<AtomicBool>) -> Watcher {
    let send = move |said| {
        let _ = sender.send(match said {
            Said::Note(words) => Message::Note(words),
            Said::At(share, words) => Message::At(share, words),
        });
    };
    Watcher { stop, until: None, send: Box::new(send), last: Mutex::new(Instant::now()) }
}

fn receive<T>(receiver: &Mutex<Receiver<T>>, patience: Duration) -> Result<T, RecvTimeoutError> {
    receiver.lock().map_err(|_| RecvTimeoutError::Disconnected)?.recv_timeout(patience)
}

/// For the end of work that was told to stop.
fn wait<T>(receiver: &Mutex<Receiver<Message<T>>>) {
    let since = Instant::now();
    while since.elapsed() < PATIENCE {
        match receive(receiver, LOOK) {
            Ok(Message::Done(_)) | Err(RecvTimeoutError::Disconnected) => return,
            _ => {}
        }
    }
}

fn failure(payload: &(dyn Any + Send)) -> Failure {
    if payload.is::<Stop>() {
        return Failure::Stopped;
    }
    let text = payload.downcast_ref::<String>().map(String::as_str);
    Failure::Panic(text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("unknown").to_owned())
}

fn finished<T>(py: Python, done: Result<T, Failure>, notes: Vec<String>) -> PyResult<Worked<T>> {
    match done {
        Ok(answer) => Ok(Worked { answer, notes }),
        Err(Failure::Task(error)) => Err(raised(py, &error)),
        Err(Failure::Stopped) => Err(wrong(py, "the work ended before anything was found: give it more time")),
        Err(Failure::Panic(text)) => Err(broken(&text)),
    }
}

fn broken(words: &str) -> PyErr {
    PyRuntimeError::new_err(format!("coilwright has a defect, please report it: {words}"))
}
