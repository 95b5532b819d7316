//! Which serial ports there are. Listing opens none: opening resets some boards.

use serialport::SerialPortType;

/// A serial port, as the system describes it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PortEntry {
    /// Its path.
    pub path: String,
    /// What is known of the thing behind it; may be empty.
    pub description: String,
}

/// All serial ports that the system knows, by path. A pseudo-terminal is not among them.
pub fn list_ports() -> Result<Vec<PortEntry>, String> {
    let ports = serialport::available_ports().map_err(|error| error.description)?;
    let mut entries: Vec<PortEntry> = ports
        .into_iter()
        .map(|port| PortEntry { path: port.port_name, description: describe(port.port_type) })
        .collect();
    entries.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(entries)
}

fn describe(kind: SerialPortType) -> String {
    match kind {
        SerialPortType::BluetoothPort => "Bluetooth".to_owned(),
        SerialPortType::PciPort => "built in".to_owned(),
        SerialPortType::Unknown => String::new(),
        SerialPortType::UsbPort(usb) => {
            let words = [usb.manufacturer, usb.product, usb.serial_number];
            let words: Vec<String> = words.into_iter().flatten().collect();
            format!("USB {:04x}:{:04x} {}", usb.vid, usb.pid, words.join(" ")).trim_end().to_owned()
        }
    }
}
