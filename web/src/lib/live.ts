// The live picture: one credit a frame, so that a slow page skips frames instead of falling behind.

/** What is told with each frame of the socket, which the description has no place for. */
export interface LiveNumbers {
  number: number;
  timestamp_s: number;
  rows: number;
  cols: number;
  mean: number;
  saturated: number;
  dark: number;
  sharpness_nd: number;
  histogram: number[];
}

export interface LiveSight {
  numbers: LiveNumbers;
  picture: ImageBitmap;
}

export class LivePicture {
  private socket: WebSocket | null = null;
  private closed = false;
  private wait_ms = 500;
  stretch = false;

  constructor(
    private readonly show: (sight: LiveSight) => void,
    private readonly state: (connected: boolean) => void,
    private readonly view: number,
  ) {}

  open(): void {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/api/devices/camera/live?view=${this.view}`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.wait_ms = 500;
      this.state(true);
      this.ask(2);
    };
    socket.onmessage = (message) => void this.receive(message.data as ArrayBuffer);
    socket.onclose = () => {
      this.state(false);
      if (this.closed) return;
      setTimeout(() => !this.closed && this.open(), this.wait_ms);
      this.wait_ms = Math.min(8000, 2 * this.wait_ms);
    };
    this.socket = socket;
  }

  close(): void {
    this.closed = true;
    this.socket?.close();
  }

  ask(credits: number): void {
    if (this.socket?.readyState === WebSocket.OPEN)
      this.socket.send(JSON.stringify({ credits, stretch: this.stretch }));
  }

  private async receive(message: ArrayBuffer): Promise<void> {
    const length = new DataView(message).getUint32(0);
    const text = new TextDecoder().decode(new Uint8Array(message, 4, length));
    const jpeg = new Blob([new Uint8Array(message, 4 + length)], { type: "image/jpeg" });
    try {
      const picture = await createImageBitmap(jpeg);
      // A frame that was on its way when the page was left has no place any more.
      if (!this.closed) this.show({ numbers: JSON.parse(text) as LiveNumbers, picture });
      picture.close();
    } finally {
      this.ask(1);
    }
  }
}
