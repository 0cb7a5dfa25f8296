// SPDX-License-Identifier: Apache-2.0
// The script and the style of `palpate report`, and the page of `palpate stations`, found on the
// include path by the assembler.
  .section .rodata

  .global palpate_report_js, palpate_report_js_end
palpate_report_js:
  .incbin "report.js"
palpate_report_js_end:
  .byte 0

  .global palpate_report_css, palpate_report_css_end
palpate_report_css:
  .incbin "report.css"
palpate_report_css_end:
  .byte 0

  .global palpate_stations_html, palpate_stations_html_end
palpate_stations_html:
  .incbin "stations.html"
palpate_stations_html_end:
  .byte 0

  .global palpate_stations_js, palpate_stations_js_end
palpate_stations_js:
  .incbin "stations.js"
palpate_stations_js_end:
  .byte 0

  .section .note.GNU-stack, "", %progbits
