//! Weights that arrive while the window is open: JSON lines over TCP, Open Sound Control and Live Link Face over UDP, on one
//! port.
//!
//! ```text
//! Maya --TCP, a JSON object a line--+
//! OSC --UDP-------------------------+--> threads --Event--> Live::events --> Model::take_live, Recorder
//! Live Link Face --UDP--------------+
//! ```
//!
//! The threads only read: what arrives changes weights and nothing else. Lines, datagrams and connections have limits.

mod json_lines;
mod live_link_face;
mod open_sound;
mod recorder;

use std::net::{SocketAddr, TcpListener, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

pub use recorder::Recorder;

use crate::error::{Failure, Outcome};

/// Where Maya's menu sends by default: this machine only.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:47511";
/// Between two looks at whether to stop.
const PATIENCE: Duration = Duration::from_millis(100);
/// Connections at a time.
const MOST_CONNECTIONS: usize = 8;
/// Largest datagram: what UDP can carry.
const LARGEST_DATAGRAM: usize = 65_536;
/// Events that wait: a sender that is faster than the window loses the oldest news, not memory.
const MOST_WAITING: usize = 4096;

/// Weights that changed together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Weights {
    /// By names of shapes in any spelling.
    pub shapes: Vec<(String, f32)>,
    /// By names of expressions.
    pub expressions: Vec<(String, f32)>,
    /// By names of states.
    pub states: Vec<(String, f32)>,
    /// Yaw, pitch and roll as a sequence has them, degrees.
    pub head_degrees: Option<[f32; 3]>,
}

/// What a sender did.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// Somebody connected, with a name.
    Connected(String),
    /// Weights arrived.
    Weights(Weights),
    /// Somebody is gone; the weights stay.
    Gone(String),
    /// Something that is no message, and why.
    Wrong(String),
}

/// A socket that is listened to until this is dropped.
pub struct Live {
    /// The address, with the port that the system chose if none was asked for.
    pub address: SocketAddr,
    events: Receiver<(Instant, Event)>,
    stop: Arc<AtomicBool>,
}

/// What the threads share.
#[derive(Clone)]
struct Post {
    sender: Sender<(Instant, Event)>,
    waiting: Arc<std::sync::atomic::AtomicUsize>,
    wake: Arc<dyn Fn() + Send + Sync>,
    stop: Arc<AtomicBool>,
}

impl Post {
    fn send(&self, event: Event) {
        if self.waiting.fetch_add(1, Ordering::Relaxed) >= MOST_WAITING {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
            return;
        }
        if self.sender.send((Instant::now(), event)).is_ok() {
            (self.wake)();
        }
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

impl Live {
    /// Listens to an address, for TCP and UDP; `wake` is called after news.
    ///
    /// # Errors
    /// The address is in use, or is not one of this machine.
    pub fn listen(
        address: SocketAddr,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Outcome<(Self, LiveCount)> {
        let refused = |what: &str, e: std::io::Error| {
            let hint = "another program, perhaps another `rubor view`, listens there: end it, or take another port, such as \
                        `--live 127.0.0.1:0` for a free one";
            let failure = Failure::job(format!("live: {address} cannot be listened to by {what}: {e}"));
            if e.kind() == std::io::ErrorKind::AddrInUse { failure.hint(hint) } else { failure }
        };
        let tcp = TcpListener::bind(address).map_err(|e| refused("TCP", e))?;
        let address = tcp.local_addr().map_err(|e| refused("TCP", e))?;
        let udp = UdpSocket::bind(address).map_err(|e| refused("UDP", e))?;
        tcp.set_nonblocking(true).map_err(|e| refused("TCP", e))?;
        udp.set_read_timeout(Some(PATIENCE)).map_err(|e| refused("UDP", e))?;
        let (sender, events) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let waiting = Arc::new(std::sync::atomic::AtomicUsize::new(0));
        let post = Post { sender, waiting: waiting.clone(), wake: Arc::new(wake), stop: stop.clone() };
        let of_tcp = post.clone();
        std::thread::spawn(move || accept(&tcp, &of_tcp));
        std::thread::spawn(move || datagrams(&udp, &post));
        Ok((Self { address, events, stop }, LiveCount(waiting)))
    }

    /// News since the last call, oldest first.
    pub fn events(&self, count: &LiveCount) -> Vec<(Instant, Event)> {
        let events: Vec<_> = self.events.try_iter().collect();
        count.0.fetch_sub(events.len().min(count.0.load(Ordering::Relaxed)), Ordering::Relaxed);
        events
    }
}

/// Number of events that wait.
pub struct LiveCount(Arc<std::sync::atomic::AtomicUsize>);

impl Drop for Live {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

fn accept(listener: &TcpListener, post: &Post) {
    let open = Arc::new(std::sync::atomic::AtomicUsize::new(0));
    while !post.is_stopped() {
        match listener.accept() {
            Ok((stream, from)) => {
                if open.fetch_add(1, Ordering::Relaxed) >= MOST_CONNECTIONS {
                    open.fetch_sub(1, Ordering::Relaxed);
                    post.send(Event::Wrong(format!("{from}: refused, {MOST_CONNECTIONS} are connected")));
                    continue;
                }
                let (post, open) = (post.clone(), open.clone());
                std::thread::spawn(move || {
                    json_lines::read(stream, &from.to_string(), &post);
                    open.fetch_sub(1, Ordering::Relaxed);
                });
            }
            Err(_) => std::thread::sleep(PATIENCE / 5),
        }
    }
}

fn datagrams(socket: &UdpSocket, post: &Post) {
    let mut bytes = vec![0; LARGEST_DATAGRAM];
    while !post.is_stopped() {
        let Ok((length, from)) = socket.recv_from(&mut bytes) else { continue };
        let datagram = &bytes[..length];
        let weights = match datagram.first() {
            Some(b'/' | b'#') => open_sound::weights(datagram),
            _ => live_link_face::weights(datagram),
        };
        match weights {
            Ok(weights) if weights == Weights::default() => {}
            Ok(weights) => post.send(Event::Weights(weights)),
            Err(why) => post.send(Event::Wrong(format!("datagram from {from}: {why}"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn wait(live: &Live, count: &LiveCount, number: usize) -> Vec<Event> {
        let start = Instant::now();
        let mut events = Vec::new();
        while events.len() < number && start.elapsed() < Duration::from_secs(5) {
            events.extend(live.events(count).into_iter().map(|(_, e)| e));
            std::thread::sleep(Duration::from_millis(5));
        }
        events
    }

    #[test]
    fn one_port_takes_lines_and_datagrams_and_is_busy_for_others() {
        let (live, count) = Live::listen("127.0.0.1:0".parse().unwrap(), || ()).unwrap();
        let busy = Live::listen(live.address, || ()).map(|_| ()).unwrap_err();
        assert!(
            busy.to_string().contains(&live.address.to_string()) && busy.to_string().contains("hint"),
            "{busy}"
        );
        let mut maya = std::net::TcpStream::connect(live.address).unwrap();
        maya.write_all(b"{\"from\":\"maya\",\"type\":\"hello\",\"version\":1}\n{\"head\":{\"pitchDegrees\":1,\"rollDegrees\":2,\"yawDegrees\":4},\"shapes\":{\"jawOpen\":0.3},\"type\":\"weights\"}\nnonsense\n{\"type\":\"bye\"}\n").unwrap();
        let events = wait(&live, &count, 4);
        assert!(matches!(&events[0], Event::Connected(who) if who.contains("maya")), "{events:?}");
        let weights = Weights {
            shapes: vec![("jawOpen".into(), 0.3)],
            head_degrees: Some([4.0, 1.0, 2.0]),
            ..Weights::default()
        };
        assert_eq!(events[1], Event::Weights(weights));
        assert!(matches!(&events[2], Event::Wrong(why) if why.contains("line 3")), "{events:?}");
        assert!(matches!(&events[3], Event::Gone(_)), "{events:?}");
        let udp = UdpSocket::bind("127.0.0.1:0").unwrap();
        udp.send_to(b"/jawOpen\0\0\0\0,f\0\0\x3f\0\0\0", live.address).unwrap();
        udp.send_to(b"\x07what", live.address).unwrap();
        let events = wait(&live, &count, 2);
        let weights = Weights { shapes: vec![("jawOpen".into(), 0.5)], ..Weights::default() };
        assert_eq!(events[0], Event::Weights(weights));
        assert!(matches!(&events[1], Event::Wrong(_)), "{events:?}");
    }
}
