"""A slow network: a proxy on loopback that passes a limited number of bits a second."""

import asyncio
import contextlib
import threading


class SlowLink:
    """Proxy before a server, in a thread of its own.

    Each direction passes ``bandwidth`` bits a second, in pieces of at most 1400 bytes
    with 40 bytes of headers each.
    """

    def __init__(self, port, bandwidth):
        self._port, self._bandwidth = port, bandwidth
        self._loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self.port = 0
        threading.Thread(target=self._run, daemon=True).start()
        self._ready.wait()

    def _run(self):
        self._loop.run_until_complete(self._serve())

    async def _serve(self):
        server = await asyncio.start_server(self._connected, "127.0.0.1", 0)
        self.port = server.sockets[0].getsockname()[1]
        self._ready.set()
        await server.serve_forever()

    async def _connected(self, reader, writer):
        there = await asyncio.open_connection("127.0.0.1", self._port, limit=2048)
        await asyncio.gather(self._pass(reader, there[1]), self._pass(there[0], writer))

    async def _pass(self, reader, writer):
        # The socket's own buffers would hide a queue from nobody: it waits in them.
        due = self._loop.time()
        with contextlib.suppress(OSError):
            while data := await reader.read(1400):
                due = max(due, self._loop.time())
                due += 8.0 * (len(data) + 40) / self._bandwidth
                await asyncio.sleep(due - self._loop.time())
                writer.write(data)
        writer.close()
