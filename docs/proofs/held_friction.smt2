; held_friction: theory §2.3. Over a path of length l Coulomb friction dissipates at least the work of
; any constant h whose components are within a1, a2, a3, the shares of f_co. m its norm, w its work
; over the displacement, at most m n (cauchy_schwarz), n the length of that.
(set-logic QF_NRA)
(declare-const fco Real)
(declare-const a1 Real)
(declare-const a2 Real)
(declare-const a3 Real)
(declare-const h1 Real)
(declare-const h2 Real)
(declare-const h3 Real)
(declare-const m Real)
(declare-const n Real)
(declare-const l Real)
(declare-const w Real)
(assert (and (>= fco 0) (>= m 0) (>= n 0)))
(assert (<= n l))
(assert (<= (+ (* a1 a1) (* a2 a2) (* a3 a3)) (* fco fco)))  ; dropped in the twin
(assert (and (<= h1 a1) (<= (- h1) a1) (<= h2 a2) (<= (- h2) a2) (<= h3 a3) (<= (- h3) a3)))
(assert (= (* m m) (+ (* h1 h1) (* h2 h2) (* h3 h3))))
(assert (<= w (* m n)))
(assert (and (<= (* h1 h1) (* a1 a1)) (<= (* h2 h2) (* a2 a2)) (<= (* h3 h3) (* a3 a3))))  ; hint
(assert (<= (* m m) (* fco fco)))  ; hint
(assert (<= m fco))  ; hint
(assert (<= (* m n) (* fco n)))  ; hint
(assert (<= (* fco n) (* fco l)))  ; hint
(assert (> w (* fco l)))  ; negated conclusion
(check-sat)
