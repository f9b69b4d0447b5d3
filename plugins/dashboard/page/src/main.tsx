// The operator's page. A widget's path shows only one part of the page.
import { render } from "preact";
import { AlertAnnouncer, Alerts } from "./alerts/Alerts";
import { startSound } from "./alerts/sound";
import { startSpeech } from "./alerts/speech";
import { start } from "./feed/client";
import { Help } from "./keys/Help";
import { startKeys } from "./keys/keys";
import { Replay } from "./replay/Replay";
import { Section } from "./section/Section";
import { History } from "./side/History";
import { Back, Metres } from "./side/Metres";
import { NoteDialog, Notes } from "./side/Notes";
import { Sensors } from "./side/Sensors";
import { Result } from "./speed/Result";
import { Announcer, Condition, Place, Speed } from "./speed/Speed";
import { hasEnded, isOld, lost_s, shown } from "./store/age";
import { prefs, setPrefs } from "./store/prefs";
import { store } from "./store/store";
import { useTopics } from "./store/topic";
import "./style/palettes.css";
import "./style/page.css";
import "./style/panels.css";
import { Status } from "./ui/Status";
import { Token } from "./ui/Token";
import { startVoice } from "./voice/record";
import { Wall } from "./wall/Wall";

function Top() {
  useTopics(store.topics.state);
  return <header class="top"><Condition />{hasEnded(store) ? <Result /> : <Speed />}<Place /></header>;
}

function Whole() {
  return (
    <>
      <h1 class="sr">headrace</h1>
      <Top />
      <Token />
      <main>
        <Wall />
        <Alerts />
        <div class="lower"><Section /><Sensors /><div class="stack"><Metres /><Notes /></div><div class="stack"><Back /><History /></div></div>
      </main>
      <Replay />
      <Status />
      <Announcer />
      <AlertAnnouncer />
      <NoteDialog />
      <Help />
    </>
  );
}

const WIDGETS: Record<string, () => preact.JSX.Element> = {
  speed: () => <><h1 class="sr">headrace: speed</h1><Token /><main><Top /></main><Announcer /></>,
  wall: () => <><h1 class="sr">headrace: wall</h1><Token /><main><Wall /></main></>,
  alerts: () => <><h1 class="sr">headrace: alerts</h1><Token /><main><Alerts /></main><AlertAnnouncer /></>,
};

/** Marks the whole page as old if the data is old, whichever part is shown. */
function watch(): void {
  const { dataset } = document.documentElement;
  const lost = lost_s(store);
  dataset["old"] = String(store.link.phase !== "refused" && !hasEnded(store) && (isOld(store) || (lost !== null && lost > 2)));
  const { word } = shown(store);
  const title = `${word} - headrace`;
  if (document.title !== title) document.title = title;
}

const widget = /\/widget\/(\w+)\/?$/.exec(location.pathname)?.[1] ?? "";
const View = WIDGETS[widget] ?? Whole;
document.documentElement.dataset["widget"] = widget in WIDGETS ? widget : "";
setPrefs({ palette: prefs.palette });
render(<View />, document.getElementById("page") as HTMLElement);
startKeys();
startSound();
startSpeech();
startVoice();
start();
store.topics.clock.on(watch);
store.topics.state.on(watch);
