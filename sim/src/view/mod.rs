//! The report while a flight goes on: the same page on 127.0.0.1, told of what is new by server-sent events.
//!
//! | address | what |
//! |---|---|
//! | `/` | the page, with what is known by now |
//! | `/events` | what is known, each time that it changes |
//!
//! It only tells: there is nothing that a browser could change. It listens on the loopback interface alone, answers nothing but
//! GET, and refuses requests for another host or from a page of another origin, so that no page elsewhere can read it
//! through a browser here.
//!
//! Limits: every event is the whole of what is known, some hundred kilobytes, at most every [`EVERY`]: made for a browser on
//! the same machine.

use std::convert::Infallible;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::Router;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::get;
use tokio::sync::watch;
use tokio_stream::StreamExt as _;
use tokio_stream::wrappers::WatchStream;

use quietpath_bridge::planning;
use quietpath_core::Metric;

use crate::fly::{Look, ended};
use crate::outcome::Failure;
use crate::page::{self, Story, Way};
use crate::rehearsal::revealed;

/// Least time between two events.
pub const EVERY: Duration = Duration::from_millis(700);
/// How many times as long as a page took to make nothing is made.
const REST: u32 = 4;

/// What the server tells: the title, and the data of the page as JSON.
#[derive(Clone, Debug, Default)]
pub struct Shown {
    /// Title of the page.
    pub title: String,
    /// What [`page::data::gather`] gave, as JSON.
    pub data: String,
}

/// When to show again: not too often, and not so often that making the page takes more than a part of the time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pace {
    due: Option<Instant>,
}

impl Pace {
    /// Whether it is time to show something new.
    #[must_use]
    pub fn is_due(&self) -> bool {
        self.due.is_none_or(|due| Instant::now() >= due)
    }

    /// Takes note of something that was shown, and that making it began then.
    pub fn shown(&mut self, begun: Instant) {
        self.due = Some(Instant::now() + EVERY.max(REST * begun.elapsed()));
    }
}

/// A server that goes on until it is dropped.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    shown: watch::Sender<Arc<Shown>>,
    _runtime: tokio::runtime::Runtime,
}

impl Server {
    /// Begins to listen on a port of 127.0.0.1; 0 takes a free one.
    ///
    /// # Errors
    /// A port that is taken, no thread for the server.
    pub fn start(port: u16) -> Result<Self, Failure> {
        let failed = |cause: std::io::Error| Failure::Input(format!("no page on 127.0.0.1:{port}: {cause}"));
        let runtime =
            tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().map_err(failed)?;
        let listener =
            runtime.block_on(tokio::net::TcpListener::bind((Ipv4Addr::LOCALHOST, port))).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let (shown, seen) = watch::channel(Arc::new(Shown::default()));
        let router = router(address, seen);
        runtime.spawn(async move {
            let _ = axum::serve(listener, router).await;
        });
        Ok(Self { address, shown, _runtime: runtime })
    }

    /// Where it listens.
    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// Shows something new to everybody who looks.
    pub fn show(&self, shown: Shown) {
        self.shown.send_replace(Arc::new(shown));
    }
}

/// The page of a flight that goes on: the way so far, the plans, the world as the bridge knows it. `None` before there is a
/// way to draw.
///
/// # Errors
/// As [`page::json`].
pub fn shown(look: Look<'_>, background: Metric) -> Result<Option<Shown>, Failure> {
    if look.track.nodes() < 2 {
        return Ok(None);
    }
    let world = revealed(look.world, look.progress.time.unwrap_or(look.track.start_time));
    let assessment = planning::assess(&world, look.track, "the flight")?;
    let stands = look.end.map_or_else(|| look.progress.phase.to_owned(), ended);
    let settings = [("the flight".to_owned(), stands), ("plans so far".to_owned(), look.steps.len().to_string())];
    let (way, steps, wire) = (Way::Flown, look.steps, look.wire);
    let story =
        Story { plan: look.track, way, assessment: &assessment, steps, wire, background, settings: &settings };
    Ok(Some(Shown { title: world.name.clone(), data: page::json(&world, &story)? }))
}

fn router(address: SocketAddr, seen: watch::Receiver<Arc<Shown>>) -> Router {
    Router::new()
        .route("/", get(index))
        .route("/events", get(events))
        .layer(middleware::from_fn(move |request, next| guard(address, request, next)))
        .with_state(seen)
}

/// Refuses what is not a GET for this host from this origin.
async fn guard(address: SocketAddr, request: Request, next: Next) -> Response {
    if request.method() != Method::GET {
        return (StatusCode::METHOD_NOT_ALLOWED, "this page can only be read\n").into_response();
    }
    if !is_ours(address, request.headers()) {
        return (StatusCode::FORBIDDEN, "this page is for a browser on this machine\n").into_response();
    }
    next.run(request).await
}

/// Whether a request is for this host and, where it says so, from this origin.
fn is_ours(address: SocketAddr, headers: &HeaderMap) -> bool {
    let hosts = [format!("127.0.0.1:{}", address.port()), format!("localhost:{}", address.port())];
    let text = |name| headers.get(name).map(|value| value.to_str().unwrap_or("?"));
    let host = text(header::HOST).is_some_and(|host| hosts.iter().any(|ours| ours == host));
    let origin =
        text(header::ORIGIN).is_none_or(|origin| hosts.iter().any(|ours| origin == format!("http://{ours}")));
    host && origin
}

async fn index(State(seen): State<watch::Receiver<Arc<Shown>>>) -> Response {
    let shown = seen.borrow().clone();
    if shown.data.is_empty() {
        let again = "<!doctype html><meta http-equiv=\"refresh\" content=\"1\"><title>quietpath</title>\
                     <link rel=\"icon\" href=\"data:,\"><p>The flight is being planned.";
        return Html(again).into_response();
    }
    Html(page::live(&shown.title, &shown.data)).into_response()
}

async fn events(
    State(seen): State<watch::Receiver<Arc<Shown>>>,
) -> Sse<impl tokio_stream::Stream<Item = Result<Event, Infallible>>> {
    let changes = WatchStream::from_changes(seen).map(|shown| Ok(Event::default().data(&shown.data)));
    Sse::new(changes).keep_alive(KeepAlive::default())
}
