; play_axes: theory §2.3. The path in space is at least the norm of the paths on the axes, by
; induction: n the norm of the paths so far, l the length of the next displacement, s the scalar
; product of the paths and the displacement's magnitudes, at most n l (cauchy_schwarz); the squares
; then sum to n^2 + 2 s + l^2.
(set-logic QF_NRA)
(declare-const L Real)
(declare-const n Real)
(declare-const l Real)
(declare-const s Real)
(declare-const r Real)  ; norm of the paths after the displacement
(assert (and (>= L 0) (>= n 0) (>= l 0) (>= r 0)))
(assert (= (* r r) (+ (* n n) (* 2 s) (* l l))))
(assert (<= s (* n l)))
(assert (>= L n))  ; dropped in the twin
(assert (=> (> r (+ n l)) (> (* r r) (* (+ n l) (+ n l)))))  ; hint
(assert (> r (+ L l)))  ; negated conclusion
(check-sat)
