//! As much of a WebSocket as the DevTools of a browser on the same machine need (RFC 6455).

use std::io::{BufReader, Error, ErrorKind, Read, Result, Write};
use std::net::TcpStream;
use std::time::Duration;

/// No message that is asked for is longer.
const LONGEST: usize = 256 << 20;

pub struct WebSocket {
    stream: BufReader<TcpStream>,
}

fn broken(message: &str) -> Error {
    Error::new(ErrorKind::InvalidData, message.to_owned())
}

impl WebSocket {
    /// Opens `path` on a port of this machine.
    pub fn open(port: u16, path: &str) -> Result<Self> {
        let mut stream = TcpStream::connect(("127.0.0.1", port))?;
        stream.set_read_timeout(Some(Duration::from_secs(60)))?;
        write!(
            stream,
            "GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
             Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
        )?;
        let mut stream = BufReader::new(stream);
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            stream.read_exact(&mut byte)?;
            head.extend(byte);
            if head.len() > 65536 {
                return Err(broken("an answer without end"));
            }
        }
        if !head.starts_with(b"HTTP/1.1 101") {
            return Err(broken(&String::from_utf8_lossy(&head)));
        }
        Ok(Self { stream })
    }

    /// Sends a text.
    pub fn send(&mut self, text: &str) -> Result<()> {
        self.stream.get_mut().write_all(&frame(text.as_bytes()))
    }

    /// The next text.
    pub fn receive(&mut self) -> Result<String> {
        receive(&mut self.stream)
    }
}

/// A frame as a client sends it: masked, here with a mask that changes nothing.
fn frame(payload: &[u8]) -> Vec<u8> {
    let mut frame = vec![0x81];
    match (u8::try_from(payload.len()), u16::try_from(payload.len())) {
        (Ok(length), _) if length < 126 => frame.push(0x80 | length),
        (_, Ok(length)) => {
            frame.push(0x80 | 0x7e);
            frame.extend(length.to_be_bytes());
        }
        _ => {
            frame.push(0x80 | 0x7f);
            frame.extend((payload.len() as u64).to_be_bytes());
        }
    }
    frame.extend([0; 4]);
    frame.extend(payload);
    frame
}

/// The next message, of one or more frames.
fn receive(stream: &mut impl Read) -> Result<String> {
    let mut message = Vec::new();
    loop {
        let mut head = [0; 2];
        stream.read_exact(&mut head)?;
        let [first, second] = head;
        let length = match second & 0x7f {
            126 => {
                let mut bytes = [0; 2];
                stream.read_exact(&mut bytes)?;
                usize::from(u16::from_be_bytes(bytes))
            }
            127 => {
                let mut bytes = [0; 8];
                stream.read_exact(&mut bytes)?;
                usize::try_from(u64::from_be_bytes(bytes)).map_err(|_| broken("a message without end"))?
            }
            short => usize::from(short),
        };
        if message.len() + length > LONGEST {
            return Err(broken("a message without end"));
        }
        let mut payload = vec![0; length];
        stream.read_exact(&mut payload)?;
        match first & 0x0f {
            0 | 1 => message.extend(payload),
            8 => return Err(broken("the browser closed the connection")),
            _ => continue,
        }
        if first & 0x80 != 0 {
            return String::from_utf8(message).map_err(|_| broken("a message that is no text"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_have_the_length_of_their_payload() {
        for length in [0, 5, 125, 126, 65_535, 65_536] {
            let text = "x".repeat(length);
            let sent = frame(text.as_bytes());
            // What a server sends differs by the bit and the bytes of the mask.
            let (head, mask) = if length < 126 {
                (2, 2)
            } else if length < 65_536 {
                (4, 4)
            } else {
                (10, 10)
            };
            let mut served = sent[..head].to_vec();
            served[1] &= 0x7f;
            served.extend(&sent[mask + 4..]);
            assert_eq!(receive(&mut served.as_slice()).unwrap(), text);
        }
    }

    #[test]
    fn pieces_are_joined_and_pings_passed_over() {
        let served = [0x01, 2, b'a', b'b', 0x89, 1, b'!', 0x80, 1, b'c'];
        assert_eq!(receive(&mut served.as_slice()).unwrap(), "abc");
        assert!(receive(&mut [0x88, 0].as_slice()).is_err());
        assert!(receive(&mut [0x81, 5, b'a'].as_slice()).is_err());
        assert!(receive(&mut [0x81, 127, 255, 255, 255, 255, 255, 255, 255, 255].as_slice()).is_err());
    }
}
