"""Reads an MCAP file record by record, up to its last whole one: also a file whose writer was killed, or that was cut.

The library takes files for granted that are whole. So here each record is first seen to be there with all of its bytes, and
only then given to the library; a chunk must have its checksum too, and be as long unpacked as it says. Where that fails the
reading ends and says why. No more than one chunk is in memory at a time.
"""

import io
import os
import struct
import zlib
from collections.abc import Iterator
from typing import BinaryIO

import lz4.frame
import zstandard
from mcap.opcode import Opcode
from mcap.records import Chunk, DataEnd, McapRecord, Message
from mcap.stream_reader import StreamReader

MAGIC = b"\x89MCAP0\r\n"
#: Larger records and chunks are taken for damage, in bytes.
LARGEST_RECORD = 2**26

_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
#: What a recording consists of; other records are passed over.
_READ = frozenset(
    {
        *map(
            int,
            (
                Opcode.HEADER,
                Opcode.SCHEMA,
                Opcode.CHANNEL,
                Opcode.MESSAGE,
                Opcode.CHUNK,
                Opcode.METADATA,
                Opcode.DATA_END,
            ),
        )
    }
)
_KNOWN = frozenset(map(int, Opcode))


class Scan:
    """The records of a file's data section; what is in chunks comes as if there were none.

    Args:
        file: a file at its beginning, with the magic bytes of MCAP.

    Attributes:
        broken: once iterated to the end: why nothing more can be read, if the file is not whole.
    """

    def __init__(self, file: BinaryIO) -> None:
        self.broken: str | None = None
        self._file = file

    def __iter__(self) -> Iterator[McapRecord]:
        size = os.fstat(self._file.fileno()).st_size
        at = len(MAGIC)
        while True:
            self._file.seek(at)
            head = self._file.read(_HEAD.size)
            if len(head) < _HEAD.size:
                self.broken = f"it ends at byte {size:,} without having been closed"
                return
            opcode, length = _HEAD.unpack(head)
            if at + _HEAD.size + length > size:
                self.broken = f"it breaks off in the middle of a record, at byte {size:,}"
                return
            if opcode not in _KNOWN:
                self.broken = f"it is damaged at byte {at:,}"
                return
            if opcode in _READ:
                try:
                    found = _records(head, self._file, length)
                except Exception:  # whatever the library makes of bytes that are no record
                    self.broken = f"it is damaged at byte {at:,}"
                    return
                if any(isinstance(record, DataEnd) for record in found):
                    self._check_end(size)
                    return
                yield from found
            at += _HEAD.size + length

    def _check_end(self, size: int) -> None:
        self._file.seek(max(size - len(MAGIC), 0))
        if self._file.read() != MAGIC:
            self.broken = "its index is cut off, though no message is missing"


def _records(head: bytes, file: BinaryIO, length: int) -> list[McapRecord]:
    """The record with `length` bytes after `head`, or those in it if it is a chunk.

    Raises:
        Exception: of any kind, if it is none.
    """
    if length > LARGEST_RECORD:
        raise ValueError(length)
    record = _record(head + file.read(length))
    return list(_inside(record)) if isinstance(record, Chunk) else [record]


def _record(content: bytes) -> McapRecord:
    return next(StreamReader(io.BytesIO(content), skip_magic=True, emit_chunks=True).records)


def _inside(chunk: Chunk) -> Iterator[McapRecord]:
    """What is in a chunk. The library finds that too, at a twentieth of the speed."""
    content = _unpacked(chunk)
    at = 0
    while at < len(content):
        opcode, length = _HEAD.unpack_from(content, at)
        begin, end = at + _HEAD.size, at + _HEAD.size + length
        if end > len(content):
            raise ValueError(end)
        if opcode == Opcode.MESSAGE:
            channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(content, begin)
            yield Message(channel, log_time, content[begin + _MESSAGE.size : end], publish_time, sequence)
        elif opcode in _READ:
            yield _record(content[at:end])
        at = end


def _unpacked(chunk: Chunk) -> bytes:
    """The content of a chunk. The library unpacks whatever there is, and what packs to little can be without end."""
    size = chunk.uncompressed_size
    if size > LARGEST_RECORD:
        raise ValueError(size)
    if chunk.compression == "zstd":
        content = zstandard.ZstdDecompressor(max_window_size=LARGEST_RECORD).stream_reader(chunk.data).read(size + 1)
    elif chunk.compression == "lz4":
        content = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    elif chunk.compression:
        raise ValueError(chunk.compression)
    else:
        content = chunk.data
    if len(content) != size or (chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc):
        raise ValueError(size)
    return content
