//! Puts the lines of a bench on byte streams, all by one clock.

use std::future::poll_fn;
use std::io;
use std::pin::{Pin, pin};
use std::task::{Context, Poll};

use firmware_protocol::Instant;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

use super::{ARRIVED_BYTES_MAX, Clock, READ_BYTES};
use crate::{Bench, Note};

/// Serves a bench over streams, one a line in the order of its lines, until the last of them has
/// ended. `boot` is when the bench was switched on: its time zero. As with [`crate::serve`],
/// what happens happens at its exact microsecond. A stream ends when its line's plug is out, and
/// `notice` is handed what there is to be noticed.
pub async fn serve_bench<S>(
    streams: Vec<S>,
    bench: &mut Bench,
    boot: tokio::time::Instant,
    notice: impl FnMut(Note),
) -> io::Result<()>
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    let mut ends: Vec<End<S>> = streams.into_iter().map(End::new).collect();
    ends.truncate(bench.lines());
    serve_ends(ends, bench, boot, None::<fn(usize) -> io::Result<S>>, notice).await
}

/// Serves a bench at ports, for good: `open` makes the port of each of its lines, and makes it
/// again when a plug that was out is in again.
pub async fn serve_bench_at<S>(
    mut open: impl FnMut(usize) -> io::Result<S>,
    bench: &mut Bench,
    boot: tokio::time::Instant,
    notice: impl FnMut(Note),
) -> io::Result<()>
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    let ends = (0..bench.lines()).map(|line| open(line).map(End::new));
    let ends = ends.collect::<io::Result<_>>()?;
    serve_ends(ends, bench, boot, Some(open), notice).await
}

async fn serve_ends<S>(
    mut ends: Vec<End<S>>,
    bench: &mut Bench,
    boot: tokio::time::Instant,
    mut open: Option<impl FnMut(usize) -> io::Result<S>>,
    mut notice: impl FnMut(Note),
) -> io::Result<()>
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    let clock = Clock(boot);
    while open.is_some() || ends.iter().any(|end| end.stream.is_some()) {
        let now = clock.now();
        bench.advance(now);
        bench.take_notes().into_iter().for_each(&mut notice);
        for (line, end) in ends.iter_mut().enumerate() {
            match (bench.is_plugged(line), &mut open) {
                (false, _) => *end = End::ended(),
                (true, Some(open)) if end.stream.is_none() => *end = End::new(open(line)?),
                _ => {}
            }
        }
        let wake = exchange(&mut ends, bench, now);
        let mut sleep = pin!(clock.sleep_until(wake));
        poll_fn(|cx| {
            let mut is_ready = sleep.as_mut().poll(cx).is_ready();
            for end in &mut ends {
                is_ready |= end.poll_write(cx)?;
                is_ready |= end.poll_read(cx)?;
            }
            if is_ready { Poll::Ready(io::Result::Ok(())) } else { Poll::Pending }
        })
        .await?;
        for (line, end) in ends.iter_mut().enumerate() {
            if !end.sent.is_empty() {
                bench.send(clock.now(), line, &std::mem::take(&mut end.sent));
            }
        }
    }
    Ok(())
}

/// Hands out what has arrived, and says which lines take more; when to look again.
fn exchange<S>(ends: &mut [End<S>], bench: &mut Bench, now: Instant) -> Option<Instant> {
    let mut wake = bench.next();
    for (line, end) in ends.iter_mut().enumerate() {
        while let Some(bytes) = bench.receive(now, line) {
            if end.arrived.len() < ARRIVED_BYTES_MAX {
                end.arrived.extend(bytes);
            }
        }
        // What the host writes faster than the wire carries waits in the stream.
        let free = bench.inward_free(line);
        end.is_open = free <= now;
        if !end.is_open {
            wake = Some(wake.map_or(free, |wake| wake.min(free)));
        }
    }
    wake
}

/// The stream at the end of a line.
struct End<S> {
    /// `None` once it has ended.
    stream: Option<S>,
    /// What waits to be written to it.
    arrived: Vec<u8>,
    /// What was read from it.
    sent: Vec<u8>,
    /// Whether the wire takes more.
    is_open: bool,
}

impl<S: AsyncRead + AsyncWrite + Unpin> End<S> {
    const fn new(stream: S) -> Self {
        Self { stream: Some(stream), arrived: Vec::new(), sent: Vec::new(), is_open: true }
    }

    /// With nothing at its end.
    const fn ended() -> Self {
        Self { stream: None, arrived: Vec::new(), sent: Vec::new(), is_open: false }
    }

    /// Whether anything came of it.
    fn poll_write(&mut self, cx: &mut Context<'_>) -> io::Result<bool> {
        let Some(stream) = self.stream.as_mut().filter(|_| !self.arrived.is_empty()) else {
            return Ok(false);
        };
        match Pin::new(stream).poll_write(cx, &self.arrived) {
            Poll::Pending => return Ok(false),
            Poll::Ready(Ok(0)) => self.stream = None,
            Poll::Ready(Ok(n)) => drop(self.arrived.drain(..n)),
            Poll::Ready(Err(e)) if e.kind() == io::ErrorKind::BrokenPipe => self.stream = None,
            Poll::Ready(Err(e)) => return Err(e),
        }
        Ok(true)
    }

    fn poll_read(&mut self, cx: &mut Context<'_>) -> io::Result<bool> {
        let Some(stream) = self.stream.as_mut().filter(|_| self.is_open) else { return Ok(false) };
        let mut bytes = [0; READ_BYTES];
        let mut buffer = ReadBuf::new(&mut bytes);
        match Pin::new(stream).poll_read(cx, &mut buffer)? {
            Poll::Pending => return Ok(false),
            Poll::Ready(()) if buffer.filled().is_empty() => self.stream = None,
            Poll::Ready(()) => self.sent.extend_from_slice(buffer.filled()),
        }
        Ok(true)
    }
}
