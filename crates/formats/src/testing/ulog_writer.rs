//! Writes PX4's ULog, by its specification.

/// A ULog in memory.
pub struct UlogWriter {
    file: Vec<u8>,
}

/// What a synchronisation message holds.
pub const SYNC_MAGIC: [u8; 8] = [0x2f, 0x73, 0x13, 0x20, 0x25, 0x0c, 0xbb, 0x12];

impl UlogWriter {
    /// A file with its header and its flags.
    pub fn new() -> Self {
        let mut file = b"ULog\x01\x12\x35\x01".to_vec();
        file.extend(112_u64.to_le_bytes());
        let mut writer = Self { file };
        writer.message(b'B', &[0; 40]);
        writer
    }

    pub fn message(&mut self, kind: u8, body: &[u8]) {
        self.file.extend(u16::try_from(body.len()).unwrap().to_le_bytes());
        self.file.push(kind);
        self.file.extend(body);
    }

    pub fn format(&mut self, text: &str) {
        self.message(b'F', text.as_bytes());
    }

    /// From here on `number` stands for an instance of a format.
    pub fn subscribe(&mut self, number: u16, instance: u8, name: &str) {
        let mut body = vec![instance];
        body.extend(number.to_le_bytes());
        body.extend(name.bytes());
        self.message(b'A', &body);
    }

    /// A message: its time and the bytes of its other fields.
    pub fn data(&mut self, number: u16, time_us: u64, fields: &[u8]) {
        let mut body = number.to_le_bytes().to_vec();
        body.extend(time_us.to_le_bytes());
        body.extend(fields);
        self.message(b'D', &body);
    }

    pub fn information(&mut self, kind: u8, key: &str, value: &[u8]) {
        let mut body = if kind == b'M' || kind == b'Q' { vec![1] } else { Vec::new() };
        body.push(u8::try_from(key.len()).unwrap());
        body.extend(key.bytes());
        body.extend(value);
        self.message(kind, &body);
    }

    pub fn synchronize(&mut self) {
        self.message(b'S', &SYNC_MAGIC);
    }

    pub fn dropout(&mut self, duration_ms: u16) {
        self.message(b'O', &duration_ms.to_le_bytes());
    }

    /// Cuts the last bytes off what is there and notes that what follows was appended.
    pub fn append_behind_cut(&mut self, cut: usize) {
        self.file.truncate(self.file.len() - cut);
        let offset = u64::try_from(self.file.len()).unwrap();
        // Behind header and message header: eight compatible flags, eight incompatible ones, three offsets.
        self.file[27] |= 1;
        let free = (0..3).map(|i| 35 + 8 * i).find(|at| self.file[*at..at + 8] == [0; 8]).unwrap();
        self.file[free..free + 8].copy_from_slice(&offset.to_le_bytes());
    }

    pub fn len(&self) -> usize {
        self.file.len()
    }

    pub fn is_empty(&self) -> bool {
        self.file.is_empty()
    }

    pub fn finish(self) -> Vec<u8> {
        self.file
    }
}

impl Default for UlogWriter {
    fn default() -> Self {
        Self::new()
    }
}

/// Numbers as the `float` of a field.
pub fn floats(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|number| (*number as f32).to_le_bytes()).collect()
}
