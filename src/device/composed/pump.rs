//! The task that owns all the ports of a composer. It lives as long as its handle: then it stops
//! the axes if they may be moving, and ends.

use std::future::poll_fn;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

use firmware_protocol::Instant;
use tokio::io::{AsyncRead as _, AsyncWrite as _, ReadBuf};
use tokio::sync::mpsc;

use super::Composer;
use crate::device::Link;
use crate::device::controller::{LinkLost, Order, Said};

/// Read at a time, bytes.
const READ_BYTES: usize = 1024;
/// Taken from a port before a time-out is served: one that never ends must not put it off.
const PIECES: usize = 16;
/// A wake-up that is due still after it was served comes again so much later: a driver that forgets to
/// put its time-out off must not keep bytes and stops from being heard.
const LULL: Duration = Duration::from_millis(1);
/// How long axes may take to come to rest once nobody listens.
const LAST_STOP: Duration = Duration::from_secs(5);

/// A port, as long as it is there.
struct Port {
    name: String,
    link: Option<Link>,
    outgoing: Vec<u8>,
}

enum Heard {
    Bytes(Vec<u8>),
    Gone(String),
}

/// Joins a composer to its ports, in the order of its drivers.
pub(in crate::device) async fn pump(
    mut composer: Composer,
    links: Vec<Link>,
    mut orders: mpsc::UnboundedReceiver<Order>,
    said: mpsc::UnboundedSender<Said>,
) {
    let origin = tokio::time::Instant::now();
    let mut ports: Vec<Port> = links.into_iter().map(Port::new).collect();
    ports.resize_with(composer.ports(), || Port {
        name: "no port".to_owned(),
        link: None,
        outgoing: Vec::new(),
    });
    // Once nobody listens: until when to wait for the axes to stand.
    let mut last_stop: Option<tokio::time::Instant> = None;
    let mut served: Option<tokio::time::Instant> = None;
    loop {
        let now = Instant::ZERO + origin.elapsed();
        composer.listen(now);
        // What was due by now may have led to words: nothing else would wake us for them.
        while load(&mut ports, &mut composer, now) {
            composer.listen(now);
        }
        while let Some(word) = composer.poll_said() {
            let _ = said.send(word);
        }
        let is_quiet = ports.iter().all(|port| port.outgoing.is_empty());
        if last_stop.is_some() && composer.is_at_rest() && is_quiet {
            return;
        }
        let wake = composer.poll_timeout().map(|at| origin + Duration::from_micros(at.micros()));
        let wake = wake.map(|at| match served {
            Some(last) if at <= last => last + LULL,
            _ => at,
        });
        let wake = [wake, last_stop].into_iter().flatten().min();
        tokio::select! {
            biased;
            order = orders.recv(), if last_stop.is_none() => {
                let now = Instant::ZERO + origin.elapsed();
                if let Some(order) = order {
                    composer.handle_order(now, order);
                } else {
                    composer.stop_for_good(now);
                    last_stop = Some(tokio::time::Instant::now() + LAST_STOP);
                }
            }
            () = tokio::time::sleep_until(wake.unwrap_or(origin)), if wake.is_some() => {
                if last_stop.is_some_and(|end| end <= tokio::time::Instant::now()) {
                    return;
                }
                served = Some(tokio::time::Instant::now());
                let now = Instant::ZERO + origin.elapsed();
                for (n, heard) in arrived(&mut ports).await {
                    hand_over(&mut composer, &ports, now, n, heard);
                }
                composer.handle_timeout(now);
            }
            (n, heard) = next(&mut ports) => {
                hand_over(&mut composer, &ports, Instant::ZERO + origin.elapsed(), n, heard);
            }
        }
    }
}

/// Takes the next words for every port that is free; whether there were any. One piece at a time:
/// what stops the axes waits for no more than that.
fn load(ports: &mut [Port], composer: &mut Composer, now: Instant) -> bool {
    let mut is_loaded = false;
    for (n, port) in ports.iter_mut().enumerate().filter(|(_, port)| port.outgoing.is_empty()) {
        if let Some(bytes) = composer.poll_transmit(now, n) {
            is_loaded |= !bytes.is_empty();
            port.outgoing = bytes;
        }
    }
    is_loaded
}

/// What the next port has to say; `None` where one has written what it had.
async fn next(ports: &mut [Port]) -> (usize, Option<Heard>) {
    poll_fn(|context| {
        for (n, port) in ports.iter_mut().enumerate() {
            if let Poll::Ready(heard) = port.poll(context) {
                return Poll::Ready((n, heard));
            }
        }
        Poll::Pending
    })
    .await
}

/// What has come by now on all ports. A host that was busy elsewhere wakes with answers and
/// time-outs both due: whoever has answered must not be called silent.
async fn arrived(ports: &mut [Port]) -> Vec<(usize, Option<Heard>)> {
    // The runtime learns of bytes where a task lets it look.
    tokio::task::yield_now().await;
    let all = poll_fn(|context| {
        let pieces = ports.iter_mut().enumerate().flat_map(|(n, port)| {
            let piece = |_| match port.poll(context) {
                Poll::Ready(heard) => Some((n, heard)),
                Poll::Pending => None,
            };
            (0..PIECES).map_while(piece).collect::<Vec<_>>()
        });
        Poll::Ready(pieces.collect())
    });
    all.await
}

fn hand_over(
    composer: &mut Composer,
    ports: &[Port],
    now: Instant,
    n: usize,
    heard: Option<Heard>,
) {
    match heard {
        Some(Heard::Bytes(bytes)) => composer.handle_bytes(now, n, &bytes),
        Some(Heard::Gone(detail)) => {
            let port = ports.get(n).map(|port| port.name.clone()).unwrap_or_default();
            composer.port_gone(now, n, LinkLost::HungUp { port, detail });
        }
        None => {}
    }
}

impl Port {
    fn new(link: Link) -> Self {
        Self { name: link.name().to_owned(), link: Some(link), outgoing: Vec::new() }
    }

    fn poll(&mut self, context: &mut Context<'_>) -> Poll<Option<Heard>> {
        let Some(link) = &mut self.link else {
            self.outgoing.clear();
            return Poll::Pending;
        };
        if !self.outgoing.is_empty() {
            match Pin::new(&mut *link).poll_write(context, &self.outgoing) {
                Poll::Ready(Ok(0)) => return self.gone("nothing can be written"),
                Poll::Ready(Ok(n)) => {
                    self.outgoing.drain(..n);
                    return Poll::Ready(None);
                }
                Poll::Ready(Err(error)) => return self.gone(&error.to_string()),
                Poll::Pending => {}
            }
        }
        let mut bytes = [0; READ_BYTES];
        let mut buffer = ReadBuf::new(&mut bytes);
        match Pin::new(link).poll_read(context, &mut buffer) {
            Poll::Ready(Ok(())) if buffer.filled().is_empty() => self.gone("end of the stream"),
            Poll::Ready(Ok(())) => Poll::Ready(Some(Heard::Bytes(buffer.filled().to_vec()))),
            Poll::Ready(Err(error)) => self.gone(&error.to_string()),
            Poll::Pending => Poll::Pending,
        }
    }

    fn gone(&mut self, detail: &str) -> Poll<Option<Heard>> {
        self.link = None;
        self.outgoing.clear();
        Poll::Ready(Some(Heard::Gone(detail.to_owned())))
    }
}
