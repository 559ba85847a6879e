// Services offered by the server, as promises.

const PATIENCE_MS = 8000;

export class Services {
  constructor(worker) {
    this.worker = worker;
    this.offered = [];
    this.waiting = new Map();
    this.next = 1;
  }

  // Handles a message of the worker; true if it is a response.
  answered({ call, bytes, error }) {
    const waits = this.waiting.get(call);
    if (!waits) return;
    this.waiting.delete(call);
    clearTimeout(waits.late);
    if (error === undefined) waits.resolve(bytes);
    else waits.reject(new Error(error));
  }

  // Offered service with a name suffix.
  find(end) {
    return this.offered.find(({ name }) => name.endsWith(`/${end}`));
  }

  call(end, request, patience = PATIENCE_MS) {
    const service = this.find(end);
    if (!service) return Promise.reject(new Error(`${end} is not offered`));
    const call = this.next++;
    return new Promise((resolve, reject) => {
      const late = setTimeout(() => this.answered({ call, error: "no reply" }), patience);
      this.waiting.set(call, { resolve, reject, late });
      this.worker.postMessage({ type: "call", service: service.id, call, request });
    });
  }
}
