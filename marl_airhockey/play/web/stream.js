// A stream of images: the next one is requested when the last one has been drawn.

import { addressOf } from "./connection.js";

const RETRY = 1000; // ms

export class Stream {
  constructor(path, wanted) { this.path = path; this.wanted = wanted; this.image = null; this.fresh = false; this.socket = null; }

  // Open or close the connection, as it is wanted now.
  update() {
    if (!this.wanted()) { if (this.socket) this.socket.close(); return; }
    if (this.socket) return;
    const socket = (this.socket = new WebSocket(addressOf(this.path)));
    socket.binaryType = "blob";
    socket.onmessage = async (event) => {
      if (!event.data.size) { socket.send("none"); return; }
      const next = await createImageBitmap(event.data);
      if (this.image) this.image.close();
      this.image = next; this.fresh = true;
    };
    socket.onclose = () => setTimeout(() => { this.socket = null; }, RETRY);
  }

  // Note that the newest image is on the screen; true if it was new.
  drawn() {
    if (!this.fresh) return false;
    this.fresh = false;
    if (this.socket && this.socket.readyState === WebSocket.OPEN) this.socket.send("drawn");
    return true;
  }
}
