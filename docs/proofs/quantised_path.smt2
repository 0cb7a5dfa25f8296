; quantised_path: theory §2.3. With each coordinate of both readings within q/2, a displacement is at
; least the measured one less w = sqrt(3) q; so are path and, squared, the viscous count. The
; triangle inequality is path_length.
(set-logic QF_NRA)
(declare-const q Real)
(declare-const w Real)
(declare-const ex Real)  ; measured less true displacement
(declare-const ey Real)
(declare-const ez Real)
(declare-const e Real)   ; its norm
(declare-const m Real)   ; measured
(declare-const d Real)   ; true
(declare-const c Real)   ; (m - w)+
(assert (and (>= q 0) (>= w 0) (>= e 0) (>= m 0) (>= d 0)))
(assert (= (* w w) (* 3 q q)))
(assert (and (<= ex q) (>= ex (- q)) (<= ey q) (>= ey (- q))))
(assert (and (<= ez q) (>= ez (- q))))  ; dropped in the twin
(assert (= (* e e) (+ (* ex ex) (* ey ey) (* ez ez))))
(assert (<= m (+ d e)))
(assert (= c (ite (> m w) (- m w) 0)))
(assert (and (<= (* ex ex) (* q q)) (<= (* ey ey) (* q q)) (<= (* ez ez) (* q q))))  ; hint
(assert (=> (> e w) (> (* e e) (* w w))))  ; hint
(assert (=> (<= c d) (<= (* c c) (* d d))))  ; hint
(assert (or (< d c) (< (* d d) (* c c))))  ; negated conclusion
(check-sat)
