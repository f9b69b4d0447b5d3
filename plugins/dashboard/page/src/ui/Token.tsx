// Asks for the token if the program requires one.
import { useRef, useState } from "preact/hooks";
import { login } from "../feed/client";
import { store } from "../store/store";
import { useTopics } from "../store/topic";

export function Token() {
  useTopics(store.topics.link);
  const field = useRef<HTMLInputElement>(null);
  const [wrong, setWrong] = useState("");
  if (store.link.phase !== "refused") return null;
  const submit = (event: Event) => {
    event.preventDefault();
    setWrong("");
    login(field.current?.value.trim() ?? "").then(
      (why) => setWrong(why),
      () => setWrong("The program doesn't answer."),
    );
  };
  return (
    <form class="token panel" onSubmit={submit}>
      <label>Token: it stands in the terminal that headrace was started in
        <input ref={field} type="password" autocomplete="off" required />
      </label>
      <button type="submit">Open</button>
      <p role="alert">{wrong}</p>
    </form>
  );
}
