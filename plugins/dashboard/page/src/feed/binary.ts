// Decodes binary frames of the feed and of /samples, little-endian: byte kind, byte version, u16 0, u32 count, u64
// seq, records.

export const HEADER_BYTES = 16;
export const SECTION_BYTES = 32;
export const SAMPLE_BYTES = 20;

export const KIND_SECTIONS = 1;
export const KIND_SAMPLES = 2;

export interface Frame { kind: number; count: number; seq: number; view: DataView }

/** Reads a frame's header. The records are not copied. */
export function frameOf(bytes: ArrayBuffer, at = 0, length = bytes.byteLength - at): Frame {
  if (length < HEADER_BYTES) throw new Error(`binary frame of ${length} bytes is shorter than its header of ${HEADER_BYTES}`);
  const head = new DataView(bytes, at, HEADER_BYTES);
  const kind = head.getUint8(0), version = head.getUint8(1), count = head.getUint32(4, true);
  if (version !== 1) throw new Error(`binary frame of version ${version}; this page reads 1`);
  const record = kind === KIND_SECTIONS ? SECTION_BYTES : kind === KIND_SAMPLES ? SAMPLE_BYTES : 0;
  if (record === 0) throw new Error(`binary frame of kind ${kind}; this page reads 1 and 2`);
  if (HEADER_BYTES + count * record > length) {
    throw new Error(`binary frame of ${length} bytes states ${count} records of ${record} bytes`);
  }
  const seq = head.getUint32(8, true) + head.getUint32(12, true) * 2 ** 32;
  return { kind, count, seq, view: new DataView(bytes, at + HEADER_BYTES, count * record) };
}
