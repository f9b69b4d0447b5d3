"""Makes ROS recordings, and tables with the same values, for tests/tests/import/ros_import.rs.

The recordings are written by rosbags, which shares no code with the reader under test. To make them again:

    pip install rosbags==0.11.9
    python3 tests/ros/make.py

With the same version of rosbags, the files are the same, byte for byte. `values.csv` and `heads.csv` contain the same
values. They are imported as tables and must give the same messages.
"""

import math
import shutil
import struct
import tempfile
from pathlib import Path

import numpy
from rosbags.rosbag1 import Writer as Bag
from rosbags.rosbag2 import StoragePlugin, Writer as Recording
from rosbags.typesys import Stores, get_typestore

HERE = Path(__file__).parent
FIRST_NS = 1_700_000_000_000_000_000
MS = 1_000_000


def single(value):
    """Rounded to single precision."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


def values():
    """Values of the sensors by name and time: a slow roll, a rotating head, a cable that is paid out."""
    for i in range(60):
        at = FIRST_NS + i * 50 * MS
        angles = (0.02 * math.sin(i / 7), 0.015 * math.cos(i / 9), 0.3 + 0.002 * i)
        rates = (0.01 * math.cos(i / 7), -0.008 * math.sin(i / 9), 0.04)
        yield at, "imu", (*angles, *rates, 0.1, -0.05, 9.81)
        if i % 2 == 0:
            yield at + 7 * MS, "depth", (151_325.0 + 50 * i,)
            yield at + 9 * MS, "tether", (3 + 0.01 * i,)
        # Every fifth ping has no return.
        yield at + 11 * MS, "ping_left", (None if i % 5 == 4 else single(2.5 + 0.01 * i),)


def beams():
    """A turn in four parts, each beam with its time: (time of the last, [(angle, range or None, time)])."""
    step, each_ns = math.radians(2.4), 31_250_000
    step = single(step)
    for part in range(4):
        first = FIRST_NS + 20 * MS + part * 800 * MS
        start = single(part * 25 * step)
        rows = []
        for i in range(25):
            angle = start + i * step
            heard = None if i % 8 == 7 else single(2.2 + 0.3 * math.sin(angle))
            rows.append((angle, heard, first + i * each_ns))
        yield rows


def stamp(types, ns):
    return types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)


def quaternion(roll, pitch, yaw):
    sr, cr = math.sin(roll / 2), math.cos(roll / 2)
    sp, cp = math.sin(pitch / 2), math.cos(pitch / 2)
    sy, cy = math.sin(yaw / 2), math.cos(yaw / 2)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def messages(store, ros1, stamped=lambda ns: ns):
    """All messages: (record time, topic, type, message), in order of time."""
    types = store.types

    def header(ns, frame):
        extra = {"seq": 0} if ros1 else {}
        return types["std_msgs/msg/Header"](stamp=stamp(types, stamped(ns)), frame_id=frame, **extra)

    def vector(x, y, z):
        return types["geometry_msgs/msg/Vector3"](x=x, y=y, z=z)

    none = numpy.zeros(9)
    found = []
    for at, name, row in values():
        if name == "imu":
            x, y, z, w = quaternion(*row[:3])
            kind = "sensor_msgs/msg/Imu"
            message = types[kind](
                header=header(at, "imu_link"),
                orientation=types["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w),
                orientation_covariance=none,
                angular_velocity=vector(*row[3:6]),
                angular_velocity_covariance=none,
                linear_acceleration=vector(*row[6:9]),
                linear_acceleration_covariance=none,
            )
            topic = "/imu/data"
        elif name == "depth":
            kind = "sensor_msgs/msg/FluidPressure"
            message = types[kind](header=header(at, "depth"), fluid_pressure=row[0], variance=0.0)
            topic = "/pressure"
        elif name == "tether":
            kind = "std_msgs/msg/Float64"
            message, topic = types[kind](data=row[0]), "/cable"
        else:
            kind = "sensor_msgs/msg/Range"
            further = {"variance": 0.0} if "variance" in types[kind].__dataclass_fields__ else {}
            message = types[kind](
                header=header(at, "ping_left"), radiation_type=0, field_of_view=0.4, min_range=0.3, max_range=30.0,
                range=math.inf if row[0] is None else row[0], **further,
            )
            topic = "/ping/left"
        found.append((at, topic, kind, message))
    for rows in beams():
        kind = "sensor_msgs/msg/LaserScan"
        ranges = [[math.inf, math.nan, 99.0, 0.1][i // 8 % 4] if r is None else r for i, (_, r, _) in enumerate(rows)]
        message = types[kind](
            header=header(rows[0][2], "sonar_0"),
            angle_min=rows[0][0], angle_max=rows[-1][0], angle_increment=single(math.radians(2.4)),
            time_increment=0.03125, scan_time=0.8, range_min=0.25, range_max=5.0,
            ranges=numpy.array(ranges, dtype=numpy.float32), intensities=numpy.zeros(0, dtype=numpy.float32),
        )
        found.append((rows[-1][2], "/sonar/scan", kind, message))
        # The same values as a point cloud in the head's own frame. Beams without a return have no point.
        kind = "sensor_msgs/msg/PointCloud2"
        field = types["sensor_msgs/msg/PointField"]
        points = b"".join(
            struct.pack("<fffxxxxI", 0.0, r * math.sin(a), -r * math.cos(a), t - rows[0][2])
            if r is not None
            else struct.pack("<fffxxxxI", math.nan, math.nan, math.nan, 0)
            for a, r, t in rows
        )
        message = types[kind](
            header=header(rows[0][2], "sonar_1"), height=1, width=len(rows),
            fields=[
                *(field(name=n, offset=4 * i, datatype=7, count=1) for i, n in enumerate("xyz")),
                field(name="t", offset=16, datatype=6, count=1),
            ],
            is_bigendian=False, point_step=20, row_step=20 * len(rows),
            data=numpy.frombuffer(points, dtype=numpy.uint8), is_dense=False,
        )
        found.append((rows[-1][2], "/sonar/points", kind, message))
    # An unused topic.
    found.append((FIRST_NS + 500 * MS, "/chatter", "std_msgs/msg/String", types["std_msgs/msg/String"](data="hello")))
    return sorted(found, key=lambda row: row[0])


def bag(path, compression=None, **further):
    store = get_typestore(Stores.ROS1_NOETIC)
    path.unlink(missing_ok=True)
    writer = Bag(path)
    if compression:
        writer.set_compression(compression)
    with writer:
        # Chunks are small, so that the file has several.
        writer.chunk_threshold = 8192
        connections = {}
        for at, topic, kind, message in messages(store, True, **further):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], at, store.serialize_ros1(message, kind))


def recording(path, release, **further):
    store = get_typestore(release)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder) / "recording"
        with Recording(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connections = {}
            for at, topic, kind, message in messages(store, False, **further):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=store)
                writer.write(connections[topic], at, store.serialize_cdr(message, kind))
        shutil.copy(next(folder.glob("*.mcap")), path)


def tables():
    """Times are in seconds, to the nanosecond; cells of sensors without a value in a row are empty."""

    def time(ns):
        return f"{ns // 10**9}.{ns % 10**9:09}"

    columns = {"imu": 9, "depth": 1, "tether": 1, "ping_left": 1}
    lines = ["t,roll,pitch,yaw,p,q,r,ax,ay,az,depth,tether,left"]
    for at, name, row in values():
        # A table can't state that an echosounder had no return.
        if row == (None,):
            continue
        cells = [repr(v) if n == name else "" for n, size in columns.items() for v in (row if n == name else [0] * size)]
        lines.append(",".join([time(at), *cells]))
    (HERE / "values.csv").write_text("\n".join(lines) + "\n")
    lines = ["t,angle,range"]
    for rows in beams():
        lines += [f"{time(t)},{a!r},{'' if r is None else repr(r)}" for a, r, t in rows]
    (HERE / "heads.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    for name, compression in [("none", None), ("bz2", Bag.CompressionFormat.BZ2), ("lz4", Bag.CompressionFormat.LZ4)]:
        bag(HERE / f"{name}.bag", compression)
    recording(HERE / "humble.mcap", Stores.ROS2_HUMBLE)
    recording(HERE / "jazzy.mcap", Stores.ROS2_JAZZY)
    # The sender's clock started when its computer was switched on, 20 s before.
    recording(HERE / "boot_time.mcap", Stores.ROS2_HUMBLE, stamped=lambda ns: ns - FIRST_NS + 20 * 10**9)
    tables()
