//! What could break: an answer taken for that to another question, a servo called silent whose
//! answer is only late, a stop that waits behind a question.

use super::*;

fn id(number: u8) -> ServoId {
    ServoId::new(number).unwrap()
}

fn ms(ms: u64) -> Instant {
    Instant::from_micros(ms * 1000)
}

/// A position as servo 1 of the maker's example answers it, and as servo 2 does.
const FIRST: [u8; 15] = [0xff, 0xff, 0xfd, 0, 1, 8, 0, 0x55, 0, 0xa6, 0, 0, 0, 0x8c, 0xc0];
const SECOND: [u8; 15] = [0xff, 0xff, 0xfd, 0, 2, 8, 0, 0x55, 0, 0x1f, 8, 0, 0, 0xba, 0xbe];
const PATIENCE: Duration = Duration::from_millis(500);
const POSITION: (u16, u16) = (132, 4);

fn asked() -> Bus {
    let mut bus = Bus::new(1_000_000);
    bus.read_all(&[id(1), id(2)], POSITION, false, PATIENCE);
    assert!(bus.poll_transmit(ms(0)).is_some());
    assert_eq!(bus.poll_transmit(ms(0)), None, "one question at a time");
    bus
}

fn numbers(heard: &Heard) -> Vec<u8> {
    heard.answers.iter().map(|status| status.id.number()).collect()
}

/// Lets time pass; who is asked is looked up, and says this so much later. What was heard and
/// when, and the addressees of all questions.
fn hear(
    bus: &mut Bus,
    mut answer: impl FnMut(u8) -> Option<(u64, [u8; 15])>,
) -> (Heard, Instant, Vec<u8>) {
    let mut now = ms(0);
    let mut on_the_wire: VecDeque<(Instant, [u8; 15])> = VecDeque::new();
    let mut asked = Vec::new();
    loop {
        if let Some(packet) = bus.poll_transmit(now) {
            asked.push(packet[4]);
            let late = answer(packet[4]).map(|(late, bytes)| (now + ms(late).since(ms(0)), bytes));
            on_the_wire.extend(late);
        }
        if let Some(heard) = bus.poll_heard() {
            return (heard, now, asked);
        }
        let arrives = on_the_wire.front().map(|(at, _)| *at);
        let next = [arrives, bus.poll_timeout()].into_iter().flatten().min();
        // None: the next one can be asked at once.
        now = next.map_or(now, |next| next.max(now));
        if let Some((_, bytes)) = on_the_wire.pop_front_if(|(at, _)| *at <= now) {
            bus.handle_bytes(now, &bytes);
        }
        bus.handle_timeout(now);
    }
}

#[test]
fn answers_come_in_the_order_of_the_question() {
    let mut bus = asked();
    bus.handle_bytes(ms(1), &SECOND);
    assert_eq!(bus.poll_heard(), None);
    bus.handle_bytes(ms(2), &FIRST);
    let heard = bus.poll_heard().unwrap();
    assert_eq!((numbers(&heard), heard.missing.len()), (vec![1, 2], 0));
    assert_eq!(bus.poll_timeout(), None, "an idle bus arms no timer");
    bus.read_all(&[id(1)], POSITION, false, PATIENCE);
    assert_eq!(bus.poll_timeout(), None, "nor one that can speak at once");
}

#[test]
fn who_does_not_answer_with_the_others_is_asked_alone_and_named() {
    let mut bus = asked();
    let (heard, now, asked) = hear(&mut bus, |id| (id == 1).then_some((0, FIRST)));
    assert_eq!(numbers(&heard), [1]);
    assert_eq!(heard.missing, [id(2)]);
    assert_eq!(asked, [1, 2, 2, 2, 2], "after both together");
    assert!(ms(500) <= now && now < ms(570), "{now:?}");
}

#[test]
fn an_answer_that_is_late_is_an_answer() {
    // Each 200 ms late: asked again and again, and taken when the first of them comes.
    let mut bus = Bus::new(1_000_000);
    bus.read_all(&[id(1)], POSITION, false, PATIENCE);
    let (heard, now, asked) = hear(&mut bus, |_| Some((200, FIRST)));
    assert_eq!((numbers(&heard), heard.missing.len()), (vec![1], 0));
    assert_eq!((now, asked.len()), (ms(200), 3));
    // Those to the other two are waited for before the next question: it is another.
    let temperature = Instruction::Read { id: id(1), address: 146, length: 1 };
    bus.ask(id(1), &temperature, 1, PATIENCE);
    assert_eq!(bus.poll_transmit(now), None);
    bus.handle_bytes(ms(261), &FIRST);
    assert_eq!(bus.poll_transmit(ms(261)), None);
    bus.handle_bytes(ms(310), &FIRST);
    assert_eq!(bus.poll_heard(), None);
    assert_eq!(bus.poll_transmit(ms(310)), temperature.encode().ok(), "now nothing is owed");
}

#[test]
fn what_is_owed_and_lost_is_not_waited_for_for_ever() {
    let mut bus = Bus::new(1_000_000);
    bus.read_all(&[id(1)], POSITION, false, PATIENCE);
    assert!(bus.poll_transmit(ms(0)).is_some());
    bus.handle_timeout(bus.poll_timeout().unwrap());
    assert!(bus.poll_transmit(ms(70)).is_some(), "again: the first one was lost");
    bus.handle_bytes(ms(71), &FIRST);
    assert!(bus.poll_heard().is_some());
    bus.read_all(&[id(1)], POSITION, false, PATIENCE);
    let quiet = bus.poll_timeout().unwrap();
    assert_eq!(quiet, ms(71) + OWED);
    bus.handle_timeout(quiet);
    assert!(bus.poll_transmit(quiet).is_some());
    bus.handle_bytes(quiet, &FIRST);
    bus.read_all(&[id(1)], POSITION, false, PATIENCE);
    assert!(bus.poll_transmit(quiet).is_some(), "and the account is clear");
}

#[test]
fn what_must_not_be_said_twice_is_said_once() {
    let mut bus = Bus::new(1_000_000);
    bus.ask_once(id(1), &Instruction::Reboot(id(1)), PATIENCE);
    let (heard, now, asked) = hear(&mut bus, |_| None);
    assert_eq!((heard.missing, asked), (vec![id(1)], vec![1]));
    assert!(ms(500) <= now && now < ms(510), "{now:?}");
}

#[test]
fn what_nobody_answers_overtakes_but_does_not_interrupt() {
    let mut bus = asked();
    let stop = Instruction::SyncWrite { address: 116, length: 4, data: vec![] };
    bus.tell(&stop);
    assert_eq!(bus.poll_transmit(ms(0)), None, "an answer is being said");
    bus.handle_bytes(ms(1), &[FIRST, SECOND].concat());
    bus.read_all(&[id(1)], POSITION, false, PATIENCE);
    assert_eq!(bus.poll_transmit(ms(1)), stop.encode().ok());
    assert!(bus.poll_transmit(ms(1)).is_some());
    // However long an answer is waited for, a stop waits for what a wire and an adapter take.
    bus.handle_timeout(bus.poll_timeout().unwrap());
    let again = ms(70);
    assert!(bus.poll_transmit(again).is_some());
    bus.tell(&stop);
    assert_eq!(bus.poll_transmit(again), None);
    let free = bus.poll_timeout().unwrap();
    assert!(free < again + Duration::from_millis(65), "{free:?}");
    assert_eq!(bus.poll_transmit(free), stop.encode().ok());
}
