//! Unpacks chunks of bags, with a size limit.

use std::io::Read;

/// Maximum unpacked size of a chunk, bytes. Recorders make chunks of less than a megabyte plus one message.
pub(super) const MOST_UNPACKED: usize = 64 << 20;

/// Result of unpacking a chunk.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Unpacked {
    /// The whole chunk.
    Whole(Vec<u8>),
    /// The available part of a chunk that is cut off by the end of the file.
    Cut(Vec<u8>),
    /// The chunk can't be unpacked, for this reason.
    Bad(&'static str),
}

/// Unpacks a chunk with the stated compression and size. `cut` means that the file ends within the chunk.
///
/// Source: ROS wiki, "Bags/Format/2.0". Compressions are none, bz2, and lz4 as roslz4 writes it, in LZ4 frames.
pub(super) fn unpack(packing: &[u8], packed: &[u8], size: u32, cut: bool) -> Unpacked {
    let Some(size) = usize::try_from(size).ok().filter(|size| *size <= MOST_UNPACKED) else {
        return Unpacked::Bad("chunks that would unpack to more than 64 MiB");
    };
    match packing {
        b"none" => judged(Ok(packed.to_vec()), size, cut),
        b"bz2" => read(bzip2::read::BzDecoder::new(packed), size, cut),
        b"lz4" => match lz4::Decoder::new(packed) {
            Ok(decoder) => read(decoder, size, cut),
            Err(_) => Unpacked::Bad("chunks that can't be unpacked"),
        },
        _ => Unpacked::Bad("chunks with an unknown compression; supported are none, bz2 and lz4"),
    }
}

fn read(reader: impl Read, size: usize, cut: bool) -> Unpacked {
    let mut unpacked = Vec::new();
    // One byte more than the stated size is read, to notice a chunk that is too long.
    let result = reader.take(size as u64 + 1).read_to_end(&mut unpacked);
    judged(if result.is_ok() { Ok(unpacked) } else { Err(unpacked) }, size, cut)
}

fn judged(unpacked: Result<Vec<u8>, Vec<u8>>, size: usize, cut: bool) -> Unpacked {
    match unpacked {
        Ok(bytes) | Err(bytes) if cut && bytes.len() <= size => Unpacked::Cut(bytes),
        Ok(bytes) if bytes.len() == size => Unpacked::Whole(bytes),
        Ok(_) => Unpacked::Bad("chunks of another length than stated"),
        Err(_) => Unpacked::Bad("chunks that can't be unpacked"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_of_another_length_than_stated_are_refused() {
        assert_eq!(unpack(b"none", b"abc", 3, false), Unpacked::Whole(b"abc".to_vec()));
        assert!(matches!(unpack(b"none", b"abc", 4, false), Unpacked::Bad(_)));
        assert_eq!(unpack(b"none", b"abc", 4, true), Unpacked::Cut(b"abc".to_vec()));
        assert!(matches!(unpack(b"none", b"abc", u32::MAX, true), Unpacked::Bad(_)));
        for packing in [b"bz2", b"lz4", b"zst"] {
            assert!(matches!(unpack(packing, b"nothing of the kind", 3, false), Unpacked::Bad(_)));
        }
    }
}
