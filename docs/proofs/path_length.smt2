; path_length: theory §2.2. The triangle inequality in space: joining two displacements p, q of
; lengths m, n never raises the counted path. By induction, integral of |v| >= |d|. p . q <= m n is
; cauchy_schwarz.
(set-logic QF_NRA)
(declare-const px Real)
(declare-const py Real)
(declare-const pz Real)
(declare-const qx Real)
(declare-const qy Real)
(declare-const qz Real)
(declare-const m Real)
(declare-const n Real)
(declare-const r Real)  ; |p + q|
(assert (and (>= m 0) (= (* m m) (+ (* px px) (* py py) (* pz pz)))))
(assert (and (>= n 0) (= (* n n) (+ (* qx qx) (* qy qy) (* qz qz)))))
(assert (<= (+ (* px qx) (* py qy) (* pz qz)) (* m n)))
(assert (>= r 0))
(assert (= (* r r) (+ (* (+ px qx) (+ px qx)) (* (+ py qy) (+ py qy)) (* (+ pz qz) (+ pz qz)))))  ; dropped in the twin
(assert (=> (> r (+ m n)) (> (* r r) (+ (* m m) (* 2 m n) (* n n)))))  ; hint
(assert (> r (+ m n)))  ; negated conclusion
(check-sat)
