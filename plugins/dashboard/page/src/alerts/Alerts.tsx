// Lists alerts that are active or need an acknowledgement, the most urgent first.
import { useEffect, useRef, useState } from "preact/hooks";
import { acknowledge, silence } from "../feed/client";
import type { Alert } from "../feed/types";
import { isUnacknowledged, sorted } from "../store/alerts";
import { store } from "../store/store";
import { useTopics } from "../store/topic";
import { span } from "../text/format";
import { PRIORITIES } from "../text/table";
import { Time } from "../ui/Time";
import { actions } from "../wall/control";
import { SoundButtons } from "./SoundButtons";

/** Maximum number of alerts in the list. Hidden alerts and those beyond this number are only counted. */
const SHOWN = 64;
/** In a list longer than this, each alert after the second takes one line until it has the focus. */
const ROOMY = 6;

export function Alerts() {
  useTopics(store.topics.alerts, store.topics.hello);
  const list = sorted(store.alerts.values());
  const waiting = list.filter(isUnacknowledged).length;
  // The program's count of hidden alerts may include some that this page has received, if they were raised after the
  // page was opened.
  const all = Math.max(list.length, store.alertsHidden > 0 ? SHOWN + store.alertsHidden : 0);
  const hidden = all - Math.min(list.length, SHOWN);
  const may = store.hello?.may.operate ?? false;
  const ol = useRef<HTMLOListElement>(null), [below, setBelow] = useState(0);
  const count = () => {
    const bottom = ol.current?.getBoundingClientRect().bottom ?? 0;
    setBelow([...(ol.current?.querySelectorAll(".alert") ?? [])].filter((item) => item.getBoundingClientRect().top > bottom - 24).length);
  };
  useEffect(count);
  return (
    <section class="panel alerts" aria-label="Alerts">
      <div class="panel-head">
        <h2>Alerts</h2>
        <span class={`count${waiting > 0 ? " waiting" : ""}`}>{waiting > 0 ? `${waiting} not acknowledged` : list.length > 0 ? `${list.length} acknowledged` : "none"}</span>
      </div>
      <div class="buttons">
        <button type="button" class="all" disabled={!may || waiting === 0} onClick={() => acknowledge(0)} title="Acknowledge all (Shift+A)">Ack all</button>
        <button type="button" disabled={!may} onClick={silence} title="Silence for 30 s (S)">Silence</button>
        <SoundButtons />
      </div>
      <ol class={`alert-list${list.length > ROOMY ? " dense" : ""}`} ref={ol} onScroll={count} tabIndex={0} aria-label="Alerts, most urgent first">
        {list.slice(0, SHOWN).map((alert) => <Item key={alert.number} alert={alert} may={may} />)}
        {list.length === 0 ? <li class="none">nothing to report</li> : null}
      </ol>
      {hidden + below > 0 ? <p class="more">{hidden + below} more hidden{below > 0 ? " below" : ""}</p> : null}
    </section>
  );
}

function Item({ alert, may }: { alert: Alert; may: boolean }) {
  const open = isUnacknowledged(alert), rectified = alert.state === "rectified";
  const go = alert.from_m === null ? null : (alert.from_m + (alert.to_m ?? alert.from_m)) / 2;
  return (
    <li class={`alert ${alert.priority}${open ? " open" : ""}${rectified ? " rectified" : ""}`} data-number={alert.number} data-state={alert.state} data-kind={alert.kind}>
      <Mark alert={alert} />
      <div class="what">
        <div class="line"><b class="priority">{PRIORITIES[alert.priority]}</b> <span class="number">#{alert.number}</span> <Since alert={alert} />{rectified ? " · rectified" : ""}{alert.acknowledged ? ` · ack ${alert.acknowledged.by}` : ""}</div>
        <div class="text" title={alert.text}>{alert.text}{alert.count > 1 ? ` (${alert.count} times)` : ""}</div>
        {alert.advice ? <div class="do">→ {alert.advice}</div> : null}
      </div>
      <div class="do-buttons">
        {go === null ? null : <button type="button" class="show" onClick={() => actions.goTo(go, 30)} aria-label={`Show alert ${alert.number} on the wall`}>Show</button>}
        {open ? <button type="button" class="ack" disabled={!may} onClick={() => acknowledge(alert.number)} aria-label={`Ack alert ${alert.number}`} title="Acknowledge (A)">Ack</button> : null}
      </div>
    </li>
  );
}

/** Shape of a priority: triangle for alarms, diamond for warnings, circle for cautions. */
function Mark({ alert }: { alert: Alert }) {
  const alarm = alert.priority === "alarm" || alert.priority === "emergency_alarm";
  return (
    <svg class="mark-shape" width="26" height="26" viewBox="0 0 24 24" aria-hidden="true">
      {alarm ? <path d="M12 1.5L23 22H1z" /> : alert.priority === "warning" ? <path d="M12 1L23 12 12 23 1 12z" /> : <circle cx="12" cy="12" r="10" />}
      <path class="in" d={alarm ? "M12 8v7M12 17.5v2" : "M12 6v8M12 16v2"} />
    </svg>
  );
}

function Since({ alert }: { alert: Alert }) {
  useTopics(store.topics.state, store.topics.hello);
  const now = store.state?.now_s;
  return <span class="since"><Time at_s={alert.since_s} more={now === undefined ? "" : `${span(now - alert.since_s)} ago`} /></span>;
}

/** Announces new alerts to a screen reader, alarms without delay. */
export function AlertAnnouncer() {
  useTopics(store.topics.alerts);
  const newest = sorted(store.alerts.values()).find((alert) => isUnacknowledged(alert) && alert.state === "active");
  const alarm = newest && newest.priority !== "warning";
  const text = newest ? `${PRIORITIES[newest.priority]}: ${newest.text}. ${newest.advice ?? ""}` : "";
  return (
    <>
      <div class="sr" role="alert">{alarm ? text : ""}</div>
      <div class="sr" aria-live="polite">{alarm ? "" : text}</div>
    </>
  );
}
