// Search where the pages are opened as files: a browser runs no worker from there, so the worker's script runs in a hidden frame
// that hears and says messages as a worker does. Where a server hands the pages out, nothing of this is used.
if (location.protocol === "file:") {
  window.IFrameWorker = class extends EventTarget {
    constructor(script) {
      super()
      window.IFrameWorker.last = this
      this.frame = document.createElement("iframe")
      this.frame.hidden = true
      this.ready = new Promise((resolve) => this.frame.addEventListener("load", resolve, { once: true }))
      this.frame.srcdoc = `
        <script>
          const owner = parent.IFrameWorker.last
          window.postMessage = (data) => owner.dispatchEvent(new MessageEvent("message", { data }))
        <\/script>
        <script src="${new URL(script, location.href)}"><\/script>`
      document.body.append(this.frame)
    }

    async postMessage(data) {
      await this.ready
      this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data }))
    }
  }
  window.Worker = window.IFrameWorker
}
