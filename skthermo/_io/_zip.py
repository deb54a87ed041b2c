"""Members of zip files, damaged files included."""

import io
import zipfile

from skthermo._io._memory_limit import MemoryLimit

PIECE = 1 << 20
PACKED_AS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # others can unpack a few bytes to megabytes at once


def read_only_member(content: bytes, suffix: str, file: str, limit: MemoryLimit) -> bytearray:
    """The one member of a zip file, given as its bytes, whose name has a suffix.

    Raises
    ------
    ValueError
        Names the file, and its members if there is not one that has the suffix; also if it is damaged or would need
        too much memory.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [member for member in archive.infolist() if not member.filename.startswith("__MACOSX/")]
            chosen = [member for member in members if member.filename.lower().endswith(suffix)]
            if len(chosen) != 1:
                names = [member.filename for member in members]
                raise ValueError(f"{len(members)} members, {names[:20]}; expected exactly one {suffix} file")
            if chosen[0].compress_type not in PACKED_AS:
                raise ValueError(f"compression of type {chosen[0].compress_type}; expected one of {PACKED_AS}")
            limit.take(chosen[0].file_size)
            return read_member(archive, chosen[0])
    except Exception as error:  # a damaged file can fail in every way
        raise ValueError(f"{file}: not readable as zip file ({error})") from error


def read_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> bytearray:
    """A member's bytes, decompressed piece by piece and compared with its checksum."""
    content, end = bytearray(member.file_size), 0
    with archive.open(member) as stream:
        while piece := stream.read(PIECE):
            content[end : end + len(piece)] = piece
            end += len(piece)
    if end != member.file_size:
        raise ValueError(f"{end} bytes; expected {member.file_size}")
    return content
