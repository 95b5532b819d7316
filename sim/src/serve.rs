//! Puts a device on a byte stream: an in-memory one in virtual time, or a pseudo-terminal in real
//! time. The only room of the crate that reads a clock, and that is tokio's.

mod lines;

use std::io;
use std::time::Duration;

use firmware_protocol::{Board, Device, Instant};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};

pub use lines::{serve_bench, serve_bench_at};

use crate::wire::{Wire, Wired};

/// What is read from the stream at a time, bytes.
const READ_BYTES: usize = 512;

/// What waits for a host that does not read; more is lost, as on a wire.
const ARRIVED_BYTES_MAX: usize = 1 << 16;

/// Serves the device over the stream, paced like the wire, until the stream ends. `boot` is when
/// the device was switched on: its time zero. What it did between two streams it did at its own
/// time: it can be served again.
///
/// Timers wake at whole milliseconds, but what happens happens at its exact microsecond: the
/// device is brought forward through every moment that has passed, in order. Bytes reach the host
/// at the first whole millisecond after they have passed.
pub async fn serve<S, B>(
    stream: S,
    device: &mut Device<B>,
    boot: tokio::time::Instant,
    wire: Wire,
) -> io::Result<()>
where
    S: AsyncRead + AsyncWrite,
    B: Board,
{
    let clock = Clock(boot);
    let (mut from_host, mut to_host) = tokio::io::split(stream);
    let mut wired = Wired::new(device, wire, clock.now());
    let mut buffer = [0; READ_BYTES];
    let mut arrived: Vec<u8> = Vec::new();
    loop {
        let now = clock.now();
        wired.advance(now);
        while let Some(bytes) = wired.receive(now) {
            if arrived.len() < ARRIVED_BYTES_MAX {
                arrived.extend(bytes);
            }
        }
        // What the host writes faster than the wire carries waits in the stream.
        let is_open = wired.inward_free() <= now;
        let opens = (!is_open).then(|| wired.inward_free());
        let wake = [wired.next(), opens].into_iter().flatten().min();
        tokio::select! {
            biased;
            () = clock.sleep_until(wake) => {}
            written = to_host.write(&arrived), if !arrived.is_empty() => match written {
                Ok(0) => return Ok(()),
                Ok(n) => drop(arrived.drain(..n)),
                Err(e) if e.kind() == io::ErrorKind::BrokenPipe => return Ok(()),
                Err(e) => return Err(e),
            },
            read = from_host.read(&mut buffer), if is_open => match read? {
                0 => return Ok(()),
                n => wired.send(clock.now(), buffer.get(..n).unwrap_or_default()),
            },
        }
    }
}

/// The device's time.
struct Clock(tokio::time::Instant);

impl Clock {
    fn now(&self) -> Instant {
        let since_boot = tokio::time::Instant::now().saturating_duration_since(self.0);
        Instant::ZERO + since_boot
    }

    async fn sleep_until(&self, wake: Option<Instant>) {
        match wake {
            None => std::future::pending().await,
            Some(wake) => {
                let since_boot = Duration::from_micros(wake.micros());
                tokio::time::sleep_until(self.0 + since_boot).await;
            }
        }
    }
}
