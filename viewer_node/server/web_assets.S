// SPDX-License-Identifier: Apache-2.0
// The page's files, found on the include path by the assembler.
  .section .rodata

  .global palpate_index_html, palpate_index_html_end
palpate_index_html:
  .incbin "index.html"
palpate_index_html_end:
  .byte 0

  .global palpate_app_js_gz, palpate_app_js_gz_end
palpate_app_js_gz:
  .incbin "app.js.gz"
palpate_app_js_gz_end:
  .byte 0

  .global palpate_app_css_gz, palpate_app_css_gz_end
palpate_app_css_gz:
  .incbin "app.css.gz"
palpate_app_css_gz_end:
  .byte 0

  .section .note.GNU-stack, "", %progbits
