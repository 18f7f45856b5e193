"""The style sheet of the study's page."""

from typing import Final

# Pictures have a white background; on a dark page they lie on a white card.
STYLE: Final = """
  :root { color-scheme: light dark; --page: #fff; --text: #222; --quiet: #5b6470;
          --link: #1f4e9c; --line: #d5dbe3; --code: #f4f5f2; }
  @media (prefers-color-scheme: dark) {
    :root { --page: #16191d; --text: #e3e6ea; --quiet: #a2abb6; --link: #8db7ff;
            --line: #363d46; --code: #22272d; }
    .picture { padding: .6rem; border-radius: .5rem; }
  }
  * { box-sizing: border-box; }
  html { scroll-padding-top: 1rem; }
  body { margin: 0 auto; max-width: 72rem; padding: 1.5rem 1rem 4rem;
         background: var(--page); color: var(--text);
         font: 1rem/1.55 system-ui, sans-serif; }
  header, nav { max-width: 48rem; margin: 0 auto; }
  h1 { font-size: 1.6rem; line-height: 1.25; margin: 0 0 .6rem; }
  a { color: var(--link); }
  :focus-visible { outline: .2rem solid var(--link); outline-offset: .2rem; }
  nav ul { columns: 22rem 2; column-gap: 2rem; margin: 1.5rem 0 3rem; padding: 0;
           list-style: none; }
  nav li { break-inside: avoid; padding-left: 2.6rem; text-indent: -2.6rem; }
  nav a { display: block; padding: .1rem 0; text-decoration: none; }
  nav a:hover { text-decoration: underline; }
  nav span { display: inline-block; width: 2.6rem; text-indent: 0;
             color: var(--quiet); }
  figure { margin: 0 0 4rem; }
  .picture { display: block; width: fit-content; max-width: 100%; margin: 0 auto 1rem;
             background: #fff; cursor: zoom-in; }
  .picture img { display: block; max-width: 100%; height: auto; }
  figcaption { max-width: 48rem; margin: 0 auto; }
  h2 { font-size: 1.15rem; line-height: 1.35; margin: 0 0 .4rem; }
  h2 span { margin-right: .3rem; color: var(--quiet); font-weight: normal; }
  figcaption p { margin: 0 0 .5rem; }
  details { border-left: .2rem solid var(--line); padding-left: .8rem; }
  summary { width: fit-content; color: var(--quiet); cursor: pointer; }
  details p { margin-top: .5rem; }
  pre { margin: .5rem 0; padding: .5rem .7rem; background: var(--code);
        border-radius: .3rem; overflow-x: auto;
        font: .82rem/1.6 ui-monospace, monospace; }
  code { font: inherit; }
  dialog { width: 100vw; height: 100vh; max-width: none; max-height: none; margin: 0;
           border: 0; padding: 0; background: #fff; color: #222; color-scheme: light; }
  dialog[open] { display: flex; flex-direction: column; }
  dialog p { display: flex; justify-content: space-between; align-items: center;
             gap: 1rem; margin: 0; padding: .4rem .8rem; }
  dialog button { font: inherit; padding: .2rem .9rem; cursor: pointer; }
  dialog div { flex: 1; min-height: 0; overflow: auto; text-align: center; }
  dialog img { max-width: 100%; height: 100%; object-fit: contain; cursor: zoom-out; }
  @media (max-width: 45rem) {
    dialog img { max-width: none; height: auto; width: 220vw; }
  }
"""
