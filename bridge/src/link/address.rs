//! Where a link leads: `serial:DEVICE[:BAUD]`, `udpin:HOST:PORT`, `udpout:HOST:PORT`, `tcpin:HOST:PORT`,
//! `tcpout:HOST:PORT`, `pty:PATH`.
//!
//! | scheme | what |
//! |---|---|
//! | `serial` | a serial device; 115200 baud where none is given, which USB ignores |
//! | `udpin` | waits on a local address for datagrams, and answers whoever the vehicle is |
//! | `udpout` | sends datagrams to an address |
//! | `tcpin` | waits on a local address for connections, and answers whoever the vehicle is |
//! | `tcpout` | connects to an address |
//! | `pty` | makes a pseudo-terminal, whose other end is at the path: a serial line for simulated vehicles |

use std::fmt;
use std::str::FromStr;

/// Baud rate of a serial line that names none.
pub const BAUD: u32 = 115_200;

/// Where a link leads. Reads from text, and prints as the same text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// A serial device.
    Serial {
        /// Path of the device.
        device: String,
        /// Baud rate.
        baud: u32,
    },
    /// Waits for datagrams on a local address, `HOST:PORT`.
    UdpIn(String),
    /// Sends datagrams to an address, `HOST:PORT`.
    UdpOut(String),
    /// Waits for connections on a local address, `HOST:PORT`.
    TcpIn(String),
    /// Connects to an address, `HOST:PORT`.
    TcpOut(String),
    /// Makes a pseudo-terminal, whose other end is a serial device at this path.
    Pty(String),
}

/// An address that cannot be read: says what is wrong and what would be right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AddressError(String);

impl fmt::Display for AddressError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for AddressError {}

/// What an address looks like, for errors.
const EXAMPLES: &str = "write serial:/dev/ttyACM0:921600, udpin:0.0.0.0:14550, udpout:HOST:PORT, tcpout:HOST:PORT or \
                        tcpin:HOST:PORT";

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        let fail = |what: String| AddressError(format!("{what}; {EXAMPLES}"));
        let Some((scheme, rest)) = text.split_once(':') else {
            return Err(fail(format!("`{text}` has no scheme")));
        };
        match scheme {
            "serial" => serial(rest).map_err(fail),
            "udpin" => host_port(rest).map(Self::UdpIn).map_err(fail),
            "udpout" => host_port(rest).map(Self::UdpOut).map_err(fail),
            "tcpin" => host_port(rest).map(Self::TcpIn).map_err(fail),
            "tcpout" => host_port(rest).map(Self::TcpOut).map_err(fail),
            "pty" if rest.is_empty() => Err(fail("`pty:` names no path".to_owned())),
            "pty" => Ok(Self::Pty(rest.to_owned())),
            _ => Err(fail(format!("`{scheme}` is no kind of link"))),
        }
    }
}

fn serial(rest: &str) -> Result<Address, String> {
    // A device may contain colons itself (/dev/serial/by-path/..:1.0): only a number at the end is a rate.
    let (device, baud) = match rest.rsplit_once(':') {
        Some((device, digits)) if !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit()) => {
            (device, digits.parse().map_err(|_| format!("`{digits}` is too large a baud rate"))?)
        }
        _ => (rest, BAUD),
    };
    if device.is_empty() || baud == 0 {
        return Err(format!("`serial:{rest}` names no device or no baud rate"));
    }
    Ok(Address::Serial { device: device.to_owned(), baud })
}

fn host_port(rest: &str) -> Result<String, String> {
    match rest.rsplit_once(':') {
        Some((host, port)) if !host.is_empty() && port.parse::<u16>().is_ok() => Ok(rest.to_owned()),
        _ => Err(format!("`{rest}` is not HOST:PORT with a port from 0 to 65535")),
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial { device, baud } => write!(f, "serial:{device}:{baud}"),
            Self::UdpIn(at) => write!(f, "udpin:{at}"),
            Self::UdpOut(to) => write!(f, "udpout:{to}"),
            Self::TcpIn(at) => write!(f, "tcpin:{at}"),
            Self::TcpOut(to) => write!(f, "tcpout:{to}"),
            Self::Pty(path) => write!(f, "pty:{path}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_read_and_print_the_same() {
        for text in
            ["serial:/dev/ttyACM0:921600", "udpin:0.0.0.0:14550", "udpout:[::1]:14540", "tcpin:h:1", "pty:/tmp/a"]
        {
            assert_eq!(text.parse::<Address>().expect(text).to_string(), text);
        }
        let by_path = "serial:/dev/serial/by-path/usb-0:1.0-port".parse::<Address>().expect("colons in the path");
        assert_eq!(by_path, Address::Serial { device: "/dev/serial/by-path/usb-0:1.0-port".into(), baud: BAUD });
    }

    #[test]
    fn a_wrong_address_says_what_is_wrong_and_what_would_be_right() {
        let cases = [
            ("/dev/ttyACM0", "`/dev/ttyACM0` has no scheme"),
            ("udp:1.2.3.4:5", "`udp` is no kind of link"),
            ("udpin:14550", "`14550` is not HOST:PORT"),
            ("tcpout:host:99999", "`host:99999` is not HOST:PORT"),
            ("serial:", "`serial:` names no device"),
            ("pty:", "`pty:` names no path"),
            ("serial:/dev/x:99999999999", "`99999999999` is too large"),
        ];
        for (text, says) in cases {
            let error = text.parse::<Address>().expect_err(text).to_string();
            assert!(error.starts_with(says) && error.contains("; write serial:"), "{text}: {error}");
        }
    }
}
