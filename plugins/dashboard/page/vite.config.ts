import { defineConfig } from "vite";

// `npm run dev` and `npx vite preview` show the dive of a running program: HEADRACE=http://127.0.0.1:8881.
const program = process.env["HEADRACE"] ?? "http://127.0.0.1:8881";
const to = { target: program, changeOrigin: true, ws: true, headers: { origin: program } };
const proxy = { "/feed": to, "/samples": to, "/state.json": to, "/login": to, "/voice": to };

// Two files with fixed names beside index.html, so that the program always embeds the same list of files.
export default defineConfig({
  // Relative: BlueOS serves the page below a path of its own.
  base: "./",
  server: { proxy },
  preview: { proxy },
  build: {
    target: "es2022",
    outDir: "dist",
    emptyOutDir: true,
    modulePreload: false,
    cssCodeSplit: false,
    assetsInlineLimit: 0,
    rollupOptions: {
      output: {
        entryFileNames: "assets/page.js",
        chunkFileNames: "assets/[name].js",
        assetFileNames: "assets/[name][extname]",
        codeSplitting: false,
      },
    },
  },
  oxc: { jsx: { runtime: "automatic", importSource: "preact" } },
  test: { include: ["src/**/*.test.ts"] },
} as import("vite").UserConfig);
