//! Reads and writes dive logs with the `mcap` crate alone, as other programs do.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use mcap::{Attachment, Message, MessageStream, WriteOptions};

/// Messages that contain the devices' raw data, in the order of the log file.
pub fn raw_messages(log: &[u8]) -> Vec<Message<'_>> {
    let all = MessageStream::new(log).unwrap().map(Result::unwrap);
    all.filter(|message| message.channel.topic.starts_with("/raw/")).collect()
}

/// Writes a log with the `mcap` crate's own writer. It contains `messages` in order, and the vehicle file if given.
pub fn write_log(path: &Path, options: WriteOptions, vehicle: Option<&str>, messages: &[Message<'_>]) {
    let mut writer = options.create(BufWriter::new(File::create(path).unwrap())).unwrap();
    if let Some(vehicle) = vehicle {
        let attachment = Attachment {
            log_time: 0,
            create_time: 0,
            name: "vehicle.toml".to_owned(),
            media_type: "application/toml".to_owned(),
            data: vehicle.as_bytes().into(),
        };
        writer.attach(&attachment).unwrap();
    }
    for message in messages {
        writer.write(message).unwrap();
    }
    writer.finish().unwrap();
}
