import { describe, expect, it } from "vitest";
import { lack, recordable, refusal, seconds, type Here } from "./lack";

const here: Here = { connected: true, operates: true, recorded: true, secure: true, asks: true, type: "audio/webm" };

describe("a voice note", () => {
  it("can be recorded if nothing is missing", () => expect(lack(here)).toBeNull());
  it("gives the reason if it can't be recorded", () => {
    expect(lack({ ...here, connected: false })).toMatch(/not connected/);
    expect(lack({ ...here, operates: false })).toMatch(/viewing only/);
    expect(lack({ ...here, recorded: false })).toMatch(/isn't recorded/);
    // A page loaded over plain HTTP from another machine can't ask for a microphone either.
    expect(lack({ ...here, secure: false, asks: false, type: null })).toMatch(/https/);
    expect(lack({ ...here, type: null })).toMatch(/can't record sound/);
  });
  it("has a type that the log accepts", () => {
    expect(recordable((type) => type.startsWith("audio/mp4"))).toBe("audio/mp4");
    expect(recordable((type) => type.includes("opus"))).toBe("audio/webm;codecs=opus");
    expect(recordable(() => false)).toBeNull();
  });
  it("explains a refusal in words", () => {
    expect(refusal("NotAllowedError")).toMatch(/refused/);
    expect(refusal("NotFoundError")).toMatch(/no microphone/);
    expect(refusal("AbortError")).toMatch(/AbortError/);
  });
  it("has 1 to 60 whole seconds", () => expect([0, 1499, 1500, 60_900].map(seconds)).toEqual([1, 1, 2, 60]));
});
