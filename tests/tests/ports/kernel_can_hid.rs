//! Behaviour of the Linux kernel on which the drivers rely: CAN interfaces that go down, and counters that are
//! unplugged.
//!
//! CAN interfaces and `/dev/uhid` need root and modules. These tests are therefore ignored by default, and run on the
//! kernel of a virtual machine: `tests/vm/run -- PROGRAM kernel_can_hid:: --ignored --test-threads=1`, where PROGRAM is
//! the built `ports` test. `.ci/run` does so.

use std::fs::File;
use std::io::ErrorKind;
use std::process::Command;
use std::thread;
use std::time::{Duration, SystemTime};

use headrace_ports::uhid::{Identity, PATH, VirtualDevice};
use headrace_tether_hid::report::REFERENCE_DESCRIPTOR;
use hidapi::{DeviceInfo, HidApi, HidDevice};
use socketcan::{CanFrame, CanSocket, EmbeddedFrame, Socket, SocketOptions, StandardId};

/// Longest time that a test waits for expected data.
const LONG: Duration = Duration::from_secs(10);
/// Time for which a test waits for data that must not arrive.
const SHORT: Duration = Duration::from_millis(100);

const ENODEV: i32 = 19;
const ENETDOWN: i32 = 100;

const VENDOR_ID: u16 = 0x1209;
const PRODUCT_ID: u16 = 0x0001;

/// Runs `ip link` with the arguments in `words`, separated by spaces.
fn ip_link(words: &str) {
    let status = Command::new("ip").arg("link").args(words.split(' ')).status().unwrap();
    assert!(status.success(), "ip link {words}: {status}");
}

/// A virtual CAN interface for this test. The interface is removed when this value is dropped.
struct Interface(&'static str);

impl Interface {
    fn up(name: &'static str) -> Self {
        ip_link(&format!("add dev {name} type vcan"));
        ip_link(&format!("set {name} up"));
        Self(name)
    }

    fn socket(&self) -> CanSocket {
        let socket = CanSocket::open(self.0).unwrap();
        socket.set_read_timeout(LONG).unwrap();
        socket
    }
}

impl Drop for Interface {
    fn drop(&mut self) {
        ip_link(&format!("delete {}", self.0));
    }
}

fn frame(first: u8) -> CanFrame {
    CanFrame::new(StandardId::new(0x123).unwrap(), &[first, 2, 3]).unwrap()
}

/// Error number and error kind of a read. The read must not return a frame.
fn refused(read: std::io::Result<CanFrame>) -> (Option<i32>, ErrorKind) {
    let error = read.unwrap_err();
    println!("CAN: {error:?}");
    (error.raw_os_error(), error.kind())
}

/// Kind of the error that a read returns because no frame arrives in `SHORT`.
fn silence(socket: &CanSocket) -> ErrorKind {
    socket.set_read_timeout(SHORT).unwrap();
    let (_, kind) = refused(socket.read_frame());
    socket.set_read_timeout(LONG).unwrap();
    kind
}

#[test]
#[ignore = "needs a kernel with vcan: tests/vm/run"]
#[expect(clippy::disallowed_methods, reason = "the kernel's clock is compared with ours")]
fn frame_carries_the_kernel_receive_time() {
    let vcan = Interface::up("vcan5");
    let (sender, stamped, plain) = (vcan.socket(), vcan.socket(), vcan.socket());
    stamped.set_recv_timestamp(true).unwrap();

    // Sends a frame, and tells whether its timestamp is earlier than the time of reading it. The kernel begins to stamp
    // frames only a moment after stamping is enabled. Until the kernel does so, a frame's timestamp is the time of
    // reading.
    let stamped_early = |number| {
        let before = SystemTime::now();
        sender.write_frame(&frame(number)).unwrap();
        // Once the other socket has received the frame, the kernel has also received it for the tested socket.
        assert_eq!(plain.read_frame().unwrap().data(), [number, 2, 3]);
        let received_by = SystemTime::now();
        thread::sleep(Duration::from_millis(5));
        let (frame, at) = stamped.read_frame_with_timestamp().unwrap();
        let read = SystemTime::now();
        assert_eq!(frame.data(), [number, 2, 3]);
        let (since_sent, before_read) =
            (at.duration_since(before).unwrap(), read.duration_since(at).unwrap());
        println!("CAN: frame {number}: stamp {since_sent:?} after sending, {before_read:?} before reading");
        at <= received_by
    };
    assert!((0..200).any(stamped_early), "the kernel doesn't stamp frames");
    assert!((200..220).all(stamped_early), "a frame is stamped only when it is read");
}

#[test]
#[ignore = "needs a kernel with vcan: tests/vm/run"]
fn can_reader_recovers_once_the_interface_is_up_again() {
    let vcan = Interface::up("vcan6");
    let (sender, reader) = (vcan.socket(), vcan.socket());

    let waiting = thread::scope(|scope| {
        let waiting = scope.spawn(|| reader.read_frame());
        ip_link("set vcan6 down");
        waiting.join().unwrap()
    });
    assert_eq!(refused(waiting), (Some(ENETDOWN), ErrorKind::NetworkDown));
    assert_eq!(silence(&reader), ErrorKind::WouldBlock);
    for attempt in 0..3 {
        let error = sender.write_frame(&frame(9)).unwrap_err();
        println!("CAN: writing while down, attempt {attempt}: {error:?}");
        assert_eq!(error.raw_os_error(), Some(ENETDOWN));
    }

    ip_link("set vcan6 up");
    sender.write_frame(&frame(1)).unwrap();
    assert_eq!(reader.read_frame().unwrap().data(), [1, 2, 3]);
}

#[test]
#[ignore = "needs a kernel with vcan: tests/vm/run"]
fn unplugged_can_adapter_needs_a_new_socket() {
    let first = Interface::up("vcan7");
    let old = first.socket();
    drop(first);
    assert_eq!(refused(old.read_frame()).0, Some(ENODEV));
    let missing = CanSocket::open("vcan7").unwrap_err();
    println!("CAN: opening an absent device: {missing:?}");
    assert_eq!(missing.raw_os_error(), Some(ENODEV));

    let second = Interface::up("vcan7");
    let (sender, new) = (second.socket(), second.socket());
    sender.write_frame(&frame(4)).unwrap();
    assert_eq!(new.read_frame().unwrap().data(), [4, 2, 3]);
    assert_eq!(silence(&old), ErrorKind::WouldBlock);
}

fn plug(kernel: File, serial: &str) -> VirtualDevice<File> {
    let identity = Identity {
        name: "tether counter",
        serial,
        vendor_id: VENDOR_ID,
        product_id: PRODUCT_ID,
        descriptor: &REFERENCE_DESCRIPTOR,
    };
    VirtualDevice::plug(kernel, &identity).unwrap()
}

fn uhid() -> File {
    File::options().read(true).write(true).open(PATH).unwrap_or_else(|error| panic!("{PATH}: {error}"))
}

/// An HID report of a cable counter in the reference layout, with this count.
fn report(count: i32) -> Vec<u8> {
    let mut report = vec![1, 42, 1];
    report.extend(count.to_le_bytes());
    report.extend(1500_i32.to_le_bytes());
    report
}

/// The counter with this serial number, as the kernel lists it at present.
fn listed(api: &mut HidApi, serial: &str) -> Option<DeviceInfo> {
    api.refresh_devices().unwrap();
    let ours = |device: &&DeviceInfo| (device.vendor_id(), device.product_id()) == (VENDOR_ID, PRODUCT_ID);
    api.device_list().filter(ours).find(|device| device.serial_number() == Some(serial)).cloned()
}

/// Waits until the kernel has created the hidraw device of the counter. Returns the device and its path.
fn open(api: &mut HidApi, serial: &str) -> (HidDevice, String) {
    for _ in 0..1000 {
        if let Some(found) = listed(api, serial)
            && let Ok(device) = api.open_serial(VENDOR_ID, PRODUCT_ID, serial)
        {
            let path = found.path().to_string_lossy().into_owned();
            println!("HID: {serial} is {path}, usage page {:04X}", found.usage_page());
            assert_eq!((found.usage_page(), found.usage()), (0xFF00, 1));
            return (device, path);
        }
        thread::sleep(Duration::from_millis(10));
    }
    panic!("{serial} was plugged in but isn't listed");
}

fn read(device: &HidDevice) -> hidapi::HidResult<Vec<u8>> {
    let mut bytes = [0; 65];
    let length = device.read_timeout(&mut bytes, 10_000)?;
    Ok(bytes[..length].to_vec())
}

#[test]
#[ignore = "needs a kernel with uhid: tests/vm/run"]
fn counter_is_found_by_its_serial_number_and_read() {
    let mut api = HidApi::new().unwrap();
    let mut other = plug(uhid(), "HR-0001");
    let mut ours = plug(uhid(), "HR-0002");
    let (other_reader, _) = open(&mut api, "HR-0001");
    let (reader, _) = open(&mut api, "HR-0002");

    let mut descriptor = [0; 4096];
    let length = reader.get_report_descriptor(&mut descriptor).unwrap();
    assert_eq!(descriptor[..length], REFERENCE_DESCRIPTOR);

    ours.report(&report(-123_456)).unwrap();
    other.report(&report(5)).unwrap();
    assert_eq!(read(&reader).unwrap(), report(-123_456));
    assert_eq!(read(&other_reader).unwrap(), report(5));
    assert_eq!(reader.read_timeout(&mut descriptor, 50).unwrap(), 0, "a silent counter is no error");
}

#[test]
#[ignore = "needs a kernel with uhid: tests/vm/run"]
fn kernel_keeps_the_first_63_unread_hid_reports() {
    let mut api = HidApi::new().unwrap();
    let mut device = plug(uhid(), "HR-0003");
    let (reader, _) = open(&mut api, "HR-0003");
    for count in 0..100 {
        device.report(&report(count)).unwrap();
    }
    let mut kept = Vec::new();
    let mut bytes = [0; 65];
    while reader.read_timeout(&mut bytes, 50).unwrap() > 0 {
        kept.push(bytes[3]);
    }
    println!("HID: kept of 100 reports: {kept:?}");
    assert_eq!(kept, (0..63).collect::<Vec<u8>>());
}

#[test]
#[ignore = "needs a kernel with uhid: tests/vm/run"]
fn unplugged_counter_may_return_under_another_device_number() {
    let mut api = HidApi::new().unwrap();
    let mut device = plug(uhid(), "HR-0004");
    let (reader, first_path) = open(&mut api, "HR-0004");
    device.report(&report(7)).unwrap();
    assert_eq!(read(&reader).unwrap(), report(7));

    // Unplugging wakes a blocked reader.
    let waiting = thread::spawn(move || (read(&reader).unwrap_err(), reader));
    let kernel = device.unplug().unwrap();
    let (error, reader) = waiting.join().unwrap();
    println!("HID: unplugged: {error:?}");
    assert!(error.to_string().contains("disconnected"), "{error}");
    assert!(read(&reader).unwrap_err().to_string().contains("disconnected"), "the error persists");
    assert!(listed(&mut api, "HR-0004").is_none());
    let missing = api.open_serial(VENDOR_ID, PRODUCT_ID, "HR-0004").unwrap_err();
    println!("HID: opening an absent device: {missing:?}");
    drop(reader);

    // Another counter is plugged in first, and takes the device number that the unplugged counter had.
    let _other = plug(uhid(), "HR-0005");
    let (_other_reader, other_path) = open(&mut api, "HR-0005");
    assert_eq!(other_path, first_path);
    let mut again = plug(kernel, "HR-0004");
    let (reader, second_path) = open(&mut api, "HR-0004");
    assert_ne!(second_path, first_path);
    again.report(&report(8)).unwrap();
    assert_eq!(read(&reader).unwrap(), report(8));
}

#[test]
#[ignore = "needs a kernel with uhid: tests/vm/run"]
fn last_report_of_an_unplugged_counter_is_lost() {
    let mut api = HidApi::new().unwrap();
    let mut device = plug(uhid(), "HR-0006");
    let (reader, _) = open(&mut api, "HR-0006");
    device.report(&report(1)).unwrap();
    // Closing the emulated device counts as unplugging.
    drop(device);
    let error = read(&reader).unwrap_err();
    println!("HID: a report waited, the device went: {error:?}");
    assert!(error.to_string().contains("disconnected"), "{error}");
}
