//! One cursor for the two encodings of ROS messages, so that a field list is written once.

use super::raw_message::Encoding;
use tumble_dynamics::nalgebra::{Quaternion, Vector3};

/// Why a payload cannot be read as what it is said to be. It tells of bytes alone: what they mean is judged by who reads them, with an error of
/// their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum WireError {
    /// A field that ends behind the payload.
    #[error("the message ends at byte {length}, a field at byte {at} needs {needed} more")]
    Torn {
        /// Where the field begins.
        at: usize,
        /// Bytes it needs.
        needed: usize,
        /// Bytes of the payload.
        length: usize,
    },
    /// Bytes that no field accounts for.
    #[error("the fields end at byte {at}, the message at byte {length}")]
    LeftOver {
        /// Where the last field ends.
        at: usize,
        /// Bytes of the payload.
        length: usize,
    },
    /// A string that is not UTF-8.
    #[error("the text at byte {at} is not UTF-8")]
    NotText {
        /// Where the text begins.
        at: usize,
    },
    /// A CDR header of another kind than plain CDR, version 1.
    #[error("encapsulation {0:#06x} is not plain CDR (0x0000 or 0x0001)")]
    Encapsulation(u16),
    /// An encoding without a field layout.
    #[error("the encoding is neither ROS 1 nor CDR")]
    Encoding,
}

/// A place in a payload.
///
/// ROS 1 packs little-endian fields. CDR (version 1) begins with four bytes that name its byte order; every number stands
/// at a multiple of its size, counted from behind those four; text ends with a zero byte.
#[derive(Clone, Debug)]
pub struct Wire<'a> {
    bytes: &'a [u8],
    at: usize,
    aligned: bool,
    big_endian: bool,
}

/// Bytes of the CDR header, from whose end alignment counts.
const ENCAPSULATION_BYTES: usize = 4;

impl<'a> Wire<'a> {
    /// Begins to read a payload.
    ///
    /// # Errors
    /// [`WireError`] where the encoding has no field layout or its header is not there.
    pub fn new(encoding: Encoding, bytes: &'a [u8]) -> Result<Self, WireError> {
        let mut wire = Self { bytes, at: 0, aligned: false, big_endian: true };
        match encoding {
            Encoding::Ros1 => wire.big_endian = false,
            Encoding::Cdr => {
                let kind = u16::read(&mut wire)?;
                if kind > 1 {
                    return Err(WireError::Encapsulation(kind));
                }
                u16::read(&mut wire)?;
                wire.aligned = true;
                wire.big_endian = kind == 0;
            }
            Encoding::Json | Encoding::Other => return Err(WireError::Encoding),
        }
        Ok(wire)
    }

    /// Whether the payload is ROS 1.
    pub fn is_ros1(&self) -> bool {
        !self.aligned
    }

    /// Checks that nothing but padding is left.
    ///
    /// # Errors
    /// [`WireError::LeftOver`].
    pub fn finish(self) -> Result<(), WireError> {
        // Writers of CDR may fill up to a multiple of four or eight.
        let padding = if self.aligned { 7 } else { 0 };
        let left = self.bytes.len().saturating_sub(self.at);
        if left > padding { Err(WireError::LeftOver { at: self.at, length: self.bytes.len() }) } else { Ok(()) }
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], WireError> {
        let torn = WireError::Torn { at: self.at, needed: count, length: self.bytes.len() };
        let end = self.at.checked_add(count).ok_or(torn)?;
        let taken = self.bytes.get(self.at..end).ok_or(torn)?;
        self.at = end;
        Ok(taken)
    }

    fn number<const N: usize>(&mut self) -> Result<[u8; N], WireError> {
        if self.aligned {
            let past = self.at.wrapping_sub(ENCAPSULATION_BYTES) % N;
            if past != 0 {
                self.take(N - past)?;
            }
        }
        let torn = WireError::Torn { at: self.at, needed: N, length: self.bytes.len() };
        self.take(N)?.try_into().map_err(|_| torn)
    }

    /// The count in front of text or a sequence whose elements need at least `least` bytes each: never more than fit.
    fn count(&mut self, least: usize) -> Result<usize, WireError> {
        let count = u32::read(self)? as usize;
        let needed = count.saturating_mul(least);
        if needed > self.bytes.len().saturating_sub(self.at) {
            return Err(WireError::Torn { at: self.at, needed, length: self.bytes.len() });
        }
        Ok(count)
    }
}

/// Something that stands in a payload: numbers, text, sequences, and what is made of these.
///
/// # Example
/// ```
/// use tumble_formats::recording::Encoding;
/// use tumble_formats::recording::wire::{Field, Wire, WireError};
///
/// /// `string name`, `float32[] readings`.
/// #[derive(Debug, PartialEq)]
/// struct Readings<'a> {
///     name: &'a str,
///     readings: Vec<f32>,
/// }
/// impl<'a> Field<'a> for Readings<'a> {
///     const LEAST_BYTES: usize = <&str>::LEAST_BYTES + Vec::<f32>::LEAST_BYTES;
///     fn read(wire: &mut Wire<'a>) -> Result<Self, WireError> {
///         Ok(Self { name: Field::read(wire)?, readings: Field::read(wire)? })
///     }
/// }
/// let payload = [&2_u32.to_le_bytes()[..], b"w1", &1_u32.to_le_bytes(), &0.5_f32.to_le_bytes()].concat();
/// let mut wire = Wire::new(Encoding::Ros1, &payload)?;
/// assert_eq!(Readings::read(&mut wire)?, Readings { name: "w1", readings: vec![0.5] });
/// wire.finish()?;
/// // A message that ends too early is refused, never read beyond its end.
/// let mut torn = Wire::new(Encoding::Ros1, &payload[..11])?;
/// assert!(matches!(Readings::read(&mut torn), Err(WireError::Torn { at: 10, needed: 4, length: 11 })));
/// # Ok::<(), WireError>(())
/// ```
/// Tutorial: [the messages of a flight](https://github.com/tumble-robotics/tumble/blob/main/crates/formats/src/recording/messages.rs).
pub trait Field<'a>: Sized {
    /// Fewest bytes it takes in either encoding.
    const LEAST_BYTES: usize;
    /// Reads it.
    ///
    /// # Errors
    /// [`WireError`]
    fn read(wire: &mut Wire<'a>) -> Result<Self, WireError>;
}

macro_rules! number_field {
    ($($number:ty),*) => {$(
        impl Field<'_> for $number {
            const LEAST_BYTES: usize = size_of::<Self>();
            fn read(wire: &mut Wire<'_>) -> Result<Self, WireError> {
                let bytes = wire.number()?;
                Ok(if wire.big_endian { Self::from_be_bytes(bytes) } else { Self::from_le_bytes(bytes) })
            }
        }
    )*};
}
number_field!(u8, u16, u32, i32, f32, f64);

impl Field<'_> for bool {
    const LEAST_BYTES: usize = 1;
    fn read(wire: &mut Wire<'_>) -> Result<Self, WireError> {
        Ok(u8::read(wire)? != 0)
    }
}

impl<'a> Field<'a> for &'a str {
    const LEAST_BYTES: usize = 4;
    fn read(wire: &mut Wire<'a>) -> Result<Self, WireError> {
        let count = wire.count(1)?;
        let at = wire.at;
        let bytes = wire.take(count)?;
        let bytes = if wire.aligned { bytes.strip_suffix(b"\0").unwrap_or(bytes) } else { bytes };
        core::str::from_utf8(bytes).map_err(|_| WireError::NotText { at })
    }
}

impl<'a, T: Field<'a> + Copy + Default, const N: usize> Field<'a> for [T; N] {
    const LEAST_BYTES: usize = N * T::LEAST_BYTES;
    fn read(wire: &mut Wire<'a>) -> Result<Self, WireError> {
        let mut array = [T::default(); N];
        for element in &mut array {
            *element = T::read(wire)?;
        }
        Ok(array)
    }
}

impl<'a, T: Field<'a>> Field<'a> for Vec<T> {
    const LEAST_BYTES: usize = 4;
    fn read(wire: &mut Wire<'a>) -> Result<Self, WireError> {
        let count = wire.count(T::LEAST_BYTES)?;
        (0..count).map(|_| T::read(wire)).collect()
    }
}

impl Field<'_> for Vector3<f64> {
    const LEAST_BYTES: usize = 24;
    fn read(wire: &mut Wire<'_>) -> Result<Self, WireError> {
        Ok(Self::from(<[f64; 3]>::read(wire)?))
    }
}

/// As it stands there: neither normalised nor checked.
impl Field<'_> for Quaternion<f64> {
    const LEAST_BYTES: usize = 32;
    fn read(wire: &mut Wire<'_>) -> Result<Self, WireError> {
        let [x, y, z, w] = <[f64; 4]>::read(wire)?;
        Ok(Self::new(w, x, y, z))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ros1_packs_and_cdr_aligns_behind_its_header() {
        let mut packed = vec![7];
        packed.extend(0x0102_u16.to_le_bytes());
        packed.extend(1.5_f64.to_le_bytes());
        packed.extend(2_u32.to_le_bytes());
        packed.extend(b"ab");
        let mut wire = Wire::new(Encoding::Ros1, &packed).unwrap();
        assert_eq!(u8::read(&mut wire), Ok(7));
        assert_eq!(u16::read(&mut wire), Ok(0x0102));
        assert_eq!(f64::read(&mut wire), Ok(1.5));
        assert_eq!(<&str>::read(&mut wire), Ok("ab"));
        assert_eq!(wire.finish(), Ok(()));

        for big in [false, true] {
            let order = |mut bytes: Vec<u8>| {
                if big {
                    bytes.reverse();
                }
                bytes
            };
            let mut cdr = vec![0, u8::from(!big), 0, 0, 7, 0];
            cdr.extend(order(0x0102_u16.to_le_bytes().to_vec()));
            cdr.extend([0; 4]);
            cdr.extend(order(1.5_f64.to_le_bytes().to_vec()));
            cdr.extend(order(3_u32.to_le_bytes().to_vec()));
            cdr.extend(b"ab\0");
            cdr.push(0);
            let mut wire = Wire::new(Encoding::Cdr, &cdr).unwrap();
            assert_eq!(u8::read(&mut wire), Ok(7));
            assert_eq!(u16::read(&mut wire), Ok(0x0102));
            assert_eq!(f64::read(&mut wire), Ok(1.5));
            assert_eq!(<&str>::read(&mut wire), Ok("ab"));
            assert_eq!(wire.finish(), Ok(()));
        }
    }

    #[test]
    fn what_does_not_fit_is_said_and_not_allocated() {
        let mut wire = Wire::new(Encoding::Ros1, &[0xff; 6]).unwrap();
        let all = WireError::Torn { at: 4, needed: 0xffff_ffff, length: 6 };
        assert_eq!(<&str>::read(&mut wire.clone()), Err(all));
        assert_eq!(Vec::<u8>::read(&mut wire.clone()), Err(all));
        assert_eq!(
            Vec::<f64>::read(&mut wire.clone()),
            Err(WireError::Torn { at: 4, needed: 8 * 0xffff_ffff, length: 6 })
        );
        assert_eq!(f64::read(&mut wire), Err(WireError::Torn { at: 0, needed: 8, length: 6 }));
        assert_eq!(wire.finish(), Err(WireError::LeftOver { at: 0, length: 6 }));
        assert_eq!(Wire::new(Encoding::Cdr, &[0, 7, 0, 0]).map(|_| ()), Err(WireError::Encapsulation(7)));
        assert_eq!(Wire::new(Encoding::Cdr, &[0, 1]).map(|_| ()), Err(WireError::Torn { at: 2, needed: 2, length: 2 }));
        assert_eq!(Wire::new(Encoding::Json, b"{}").map(|_| ()), Err(WireError::Encoding));
        let mut wire = Wire::new(Encoding::Ros1, &[1, 0, 0, 0, 0xff]).unwrap();
        assert_eq!(<&str>::read(&mut wire), Err(WireError::NotText { at: 4 }));
    }

    #[test]
    fn padding_of_cdr_is_no_rest_but_eight_bytes_are() {
        let rest = |count: usize| {
            let mut bytes = vec![0, 1, 0, 0];
            bytes.resize(4 + count, 0);
            Wire::new(Encoding::Cdr, &bytes).unwrap().finish()
        };
        assert_eq!(rest(7), Ok(()));
        assert_eq!(rest(8), Err(WireError::LeftOver { at: 4, length: 12 }));
    }
}
