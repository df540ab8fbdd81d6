"""Delay and loss for what leaves one network namespace, where the kernel has no netem.

    nsenter -t PID -n python3 slow_network.py --delay 60 --jitter 10 --loss 3 --seed 1

Packets that leave by the device go into a netfilter queue; this program decides when each of them goes on, or that it does not.
It needs root and `iptables`. If it dies, packets pass as if it were not there; on SIGTERM it takes its rules back and says what
it did, as one JSON document.
"""

import argparse
import contextlib
import heapq
import json
import os
import random
import select
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator

NETLINK_NETFILTER = 12
SO_RCVBUFFORCE, SOL_NETLINK, NETLINK_NO_ENOBUFS = 33, 270, 5
QUEUE_SUBSYSTEM = 3
PACKET, VERDICT, CONFIGURE = 0, 1, 2
DROP, ACCEPT = 0, 1
REQUEST, ACKNOWLEDGE = 1, 4
QUEUE = 7


def attribute(kind: int, value: bytes) -> bytes:
    return struct.pack("=HH", 4 + len(value), kind) + value + b"\0" * (-len(value) % 4)


class Queue:
    """The netfilter queue of this network namespace: which packets wait, and what becomes of them."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, NETLINK_NETFILTER)
        self.socket.bind((0, 0))
        self.socket.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, 8 << 20)
        self.socket.setsockopt(SOL_NETLINK, NETLINK_NO_ENOBUFS, 1)
        self._sent = 0
        self._configure(1, struct.pack("!BBH", 1, 0, socket.AF_UNSPEC))  # bind
        self._configure(2, struct.pack("!IB", 0, 1))  # tell of packets, without their content
        self._configure(3, struct.pack("!I", 20_000))  # how many may wait

    def _send(self, message: int, body: bytes, flags: int) -> None:
        self._sent += 1
        payload = struct.pack("!BBH", socket.AF_UNSPEC, 0, QUEUE) + body
        header = struct.pack("=IHHII", 16 + len(payload), QUEUE_SUBSYSTEM << 8 | message, flags, self._sent, 0)
        self.socket.send(header + payload)

    def _configure(self, kind: int, value: bytes) -> None:
        self._send(CONFIGURE, attribute(kind, value), REQUEST | ACKNOWLEDGE)
        (error,) = struct.unpack_from("=i", self.socket.recv(65536), 16)
        if error:
            sys.exit(f"the netfilter queue cannot be used: {os.strerror(-error)}")

    def decide(self, packet: int, verdict: int) -> None:
        self._send(VERDICT, attribute(2, struct.pack("!II", verdict, packet)), REQUEST)

    def arrived(self) -> Iterator[int]:
        """The numbers of the packets that have come."""
        buffer = self.socket.recv(1 << 17)
        at = 0
        while at < len(buffer):
            length, kind = struct.unpack_from("=IH", buffer, at)
            if kind == QUEUE_SUBSYSTEM << 8 | PACKET:
                yield from self._number(buffer, at + 20, at + length)
            at += (length + 3) & ~3

    @staticmethod
    def _number(buffer: bytes, at: int, end: int) -> Iterator[int]:
        while at < end:
            length, kind = struct.unpack_from("=HH", buffer, at)
            if kind & 0x3FFF == 1:
                yield from struct.unpack_from("!I", buffer, at + 4)
            at += (length + 3) & ~3


@contextlib.contextmanager
def redirected(device: str) -> Iterator[None]:
    """Have what leaves by `device` go through the queue; untracked, since packets of a new flow held here would clash."""
    rules = [
        ["-t", "raw", "OUTPUT", "-o", device, "-j", "CT", "--notrack"],
        ["-t", "mangle", "POSTROUTING", "-o", device, "-j", "NFQUEUE", "--queue-num", str(QUEUE), "--queue-bypass"],
    ]

    def iptables(verb: str) -> None:
        for table, name, chain, *rule in ((one[0], one[1], one[2], *one[3:]) for one in rules):
            subprocess.run(["iptables", "-w", table, name, verb, chain, *rule], check=True)

    iptables("-A")
    try:
        yield
    finally:
        iptables("-D")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="eth0")
    for name in ("delay", "jitter", "loss"):
        parser.add_argument(f"--{name}", type=float, default=0.0, help="in milliseconds" if name != "loss" else "in %")
    parser.add_argument("--seed", type=int, required=True)
    told = parser.parse_args()
    chance, waiting, running = random.Random(told.seed), list[tuple[float, int]](), True
    packets = lost = 0

    def stop(*_: object) -> None:
        nonlocal running
        running = False

    signal.signal(signal.SIGTERM, stop)
    queue = Queue()
    with redirected(told.device):
        print("slow", flush=True)
        while running:
            left = max(0.0, waiting[0][0] - time.monotonic()) if waiting else 0.2
            if select.select([queue.socket], [], [], left)[0]:
                now = time.monotonic()
                for packet in queue.arrived():
                    packets += 1
                    if chance.random() * 100 < told.loss:
                        lost += 1
                        queue.decide(packet, DROP)
                    else:
                        late = max(0.0, chance.gauss(told.delay, told.jitter)) / 1000
                        heapq.heappush(waiting, (now + late, packet))
            while waiting and waiting[0][0] <= time.monotonic():
                queue.decide(heapq.heappop(waiting)[1], ACCEPT)
    for _, packet in waiting:
        queue.decide(packet, ACCEPT)
    print(json.dumps({"packets": packets, "lost": lost}), flush=True)


if __name__ == "__main__":
    main()
