#!/usr/bin/env python3
"""Reads a dive log with Python's `mcap` package and compares its summary with the file read from end to end.

    check.py LOG.mcap               prints differences, and exits with 1 if there are any
    check.py --self-test LOG.mcap   damages each copy of the log in one way, and checks that the damage is found

Prints "skipped" and exits with 0 if the package isn't installed.
"""

import io
import json
import struct
import sys
from collections import Counter

try:
    from mcap.reader import make_reader
    from mcap.records import Attachment, Channel, Chunk, Metadata, Schema
    from mcap.stream_reader import StreamReader, breakup_chunk
except ImportError as error:
    print(f"skipped: Python's package mcap with zstandard is not there ({error})")
    sys.exit(0)

# Opcodes of records. Source: MCAP's specification, mcap.dev/spec.
MESSAGE_INDEX, CHUNK_INDEX, ATTACHMENT_INDEX, STATISTICS, METADATA_INDEX = 7, 8, 10, 11, 13
MAGIC = 8


def records(log):
    """Opcode, position and content of each record at the file's own level."""
    at = MAGIC
    while at + 9 <= len(log) - MAGIC:
        opcode, length = struct.unpack_from("<BQ", log, at)
        yield opcode, at, log[at + 9 : at + 9 + length]
        at += 9 + length


class Linear:
    """Summary computed by reading the data alone, from the first byte to the last."""

    def __init__(self, log):
        self.messages = Counter()
        self.times = []
        self.channels, self.schemas = {}, {}
        self.chunks, self.attachments, self.metadata = {}, {}, {}
        self.index_of = {}
        chunk_at = None
        places = [place for _, place, _ in records(log)]
        reader = iter(StreamReader(io.BytesIO(log), emit_chunks=True).records)
        for place, record in zip(places, reader):
            if isinstance(record, Chunk):
                chunk_at = place
                self.chunks[place] = record
                self.index_of[place] = Counter()
                for inner in breakup_chunk(record, validate_crc=True):
                    if isinstance(inner, Channel):
                        self.channels[inner.id] = inner
                    elif isinstance(inner, Schema):
                        self.schemas[inner.id] = inner
                    else:
                        self.messages[inner.channel_id] += 1
                        self.times.append(inner.log_time)
                        self.index_of[place][(inner.channel_id, inner.log_time)] += 1
            elif isinstance(record, Attachment):
                self.attachments[place] = record
            elif isinstance(record, Metadata):
                self.metadata[place] = record
            elif type(record).__name__ == "MessageIndex":
                entries = [(record.channel_id, time) for time, _ in record.records]
                self.index_of[chunk_at].subtract(Counter(entries))
            elif type(record).__name__ == "DataEnd":
                break


def check(log, deep=True):
    """Differences, in words. `deep` also checks the indexes and reads message by message."""
    wrong = []

    def same(what, told, found):
        if told != found:
            wrong.append(f"{what}: the log says {told}, and there is {found}")

    linear = Linear(log)
    reader = make_reader(io.BytesIO(log))
    summary = reader.get_summary()
    stats = summary.statistics
    same("statistics, messages", stats.message_count, sum(linear.messages.values()))
    same("statistics, messages by channel", stats.channel_message_counts, dict(linear.messages))
    same("statistics, first time", stats.message_start_time, min(linear.times))
    same("statistics, last time", stats.message_end_time, max(linear.times))
    same("statistics, channels", stats.channel_count, len(linear.channels))
    same("statistics, schemas", stats.schema_count, len(linear.schemas))
    same("statistics, chunks", stats.chunk_count, len(linear.chunks))
    same("statistics, attachments", stats.attachment_count, len(linear.attachments))
    same("statistics, metadata", stats.metadata_count, len(linear.metadata))
    same("channels", summary.channels, linear.channels)
    same("schemas", summary.schemas, linear.schemas)
    for channel in linear.channels.values():
        json_but_no_schema = channel.message_encoding == "json" and channel.schema_id not in linear.schemas
        same(f"schema of {channel.topic}", json_but_no_schema, False)
    same("chunk indexes", sorted(index.chunk_start_offset for index in summary.chunk_indexes), sorted(linear.chunks))
    for index in summary.chunk_indexes:
        chunk = linear.chunks.get(index.chunk_start_offset)
        if chunk is not None:
            told = (index.message_start_time, index.message_end_time, index.uncompressed_size, index.compressed_size)
            found = (chunk.message_start_time, chunk.message_end_time, chunk.uncompressed_size, len(chunk.data))
            same(f"chunk index at {index.chunk_start_offset}", told, found)
    for place, left in linear.index_of.items():
        same(f"message indexes of the chunk at {place}", [key for key, count in left.items() if count != 0], [])
    told = sorted((i.offset, i.name, i.data_size) for i in summary.attachment_indexes)
    found = sorted((place, a.name, len(a.data)) for place, a in linear.attachments.items())
    same("attachment index", told, found)
    told = sorted((i.offset, i.name) for i in summary.metadata_indexes)
    same("metadata index", told, sorted((place, m.name) for place, m in linear.metadata.items()))
    if deep:
        wrong.extend(by_index(reader, linear))
        wrong.extend(view(reader))
    return wrong


def by_index(reader, linear):
    """Differences seen by a reader that uses the indexes; Python's does so when messages are requested by time."""
    try:
        found = Counter(channel.id for _, channel, _ in reader.iter_messages())
    except Exception as error:  # any error that a damaged index causes
        return [f"reading by index: {error!r}"]
    return [] if found == linear.messages else ["reading by index: other messages than from end to end"]


def view(reader):
    """Viewer messages that don't match the schema of their topic."""
    wrong = []
    try:
        for schema, channel, message in reader.iter_messages():
            if channel.message_encoding != "json":
                continue
            content, keys = json.loads(message.data), json.loads(schema.data)
            missing = [key for key in keys["required"] if key not in content]
            more = [key for key in content if key not in keys["properties"]]
            if missing or more:
                wrong.append(f"{channel.topic}: lacks {missing}, has {more}")
    except Exception as error:
        wrong.append(f"reading the view: {error!r}")
    return wrong


def spoilt(log):
    """Copies of the log with one fault each, and the words that must report it."""
    first = {}
    for opcode, place, content in records(log):
        # The first chunk holds definitions only.
        if opcode == CHUNK_INDEX and struct.unpack_from("<Q", content)[0] == 0:
            continue
        first.setdefault(opcode, (place + 9, content))

    def changed(opcode, offset, layout):
        place = first[opcode][0] + offset
        value = struct.unpack_from(layout, log, place)[0]
        copy = bytearray(log)
        struct.pack_into(layout, copy, place, value + 1)
        return bytes(copy)

    last_count = len(first[STATISTICS][1]) - 8
    yield "statistics, messages:", changed(STATISTICS, 0, "<Q")
    yield "statistics, schemas:", changed(STATISTICS, 8, "<H")
    yield "statistics, chunks:", changed(STATISTICS, 22, "<I")
    yield "statistics, messages by channel:", changed(STATISTICS, last_count, "<Q")
    yield "chunk index at", changed(CHUNK_INDEX, 0, "<Q")
    yield "chunk indexes:", changed(CHUNK_INDEX, 16, "<Q")
    yield "message indexes of", changed(MESSAGE_INDEX, 6, "<Q")
    yield "attachment index:", changed(ATTACHMENT_INDEX, 32, "<Q")
    yield "metadata index:", changed(METADATA_INDEX, 0, "<Q")


def self_test(log):
    failed = 0
    for words, copy in spoilt(log):
        found = [line for line in check(copy, deep=False) if line.startswith(words)]
        print(f"spoilt: {'found ' + found[0][:100] if found else 'NOT FOUND ' + words}")
        failed += not found
    return failed


def main():
    arguments = sys.argv[1:]
    with open(arguments[-1], "rb") as file:
        log = file.read()
    if arguments[0] == "--self-test":
        sys.exit(1 if self_test(log) else 0)
    linear = Linear(log)
    for number, channel in sorted(linear.channels.items()):
        schema = linear.schemas.get(channel.schema_id)
        name = f"{schema.name} ({schema.encoding})" if schema else "-"
        print(f"{linear.messages[number]:8} {channel.topic:28} {channel.message_encoding:26} {name}")
    wrong = check(log)
    for line in wrong:
        print(line)
    print(f"{sum(linear.messages.values())} messages, {len(linear.chunks)} chunks: {'DIFFERS' if wrong else 'as told'}")
    sys.exit(1 if wrong else 0)


main()
