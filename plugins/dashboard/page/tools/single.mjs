// Makes dist/single.html: the page in one file, for the export of a dive. The program puts the dive's data script in
// place of <!--DIVE-->.
import { readFileSync, writeFileSync } from "node:fs";

const dist = new URL("../dist/", import.meta.url);
const read = (name) => readFileSync(new URL(name, dist), "utf8");
const icon = Buffer.from(read("assets/icon.svg")).toString("base64");
// Sequences that would end the element early are escaped; both forms mean the same inside a JavaScript string.
const script = read("assets/page.js").replaceAll("</script", "<\\/script").replaceAll("<!--", "<\\!--");
const page = read("index.html");

const parts = [
  [/<link rel="icon"[^>]*>/, `<link rel="icon" href="data:image/svg+xml;base64,${icon}">`],
  [/<link rel="stylesheet"[^>]*>/, `<style>${read("assets/style.css")}</style>`],
  [/<script type="module"[^>]*><\/script>/, ""],
  ["</body>", `<!--DIVE-->\n<script type="module">${script}</script>\n</body>`],
];
let single = page;
for (const [what, by] of parts) {
  if (!(typeof what === "string" ? single.includes(what) : what.test(single))) {
    throw new Error(`dist/index.html has no ${what}`);
  }
  single = single.replace(what, () => by);
}
writeFileSync(new URL("single.html", dist), single);
